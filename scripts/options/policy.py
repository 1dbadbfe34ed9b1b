"""Settings of policies on the command line: ``--policy-set``."""

from collections.abc import Iterable, Sequence
from typing import Any


def policy_options(assignments: Iterable[str]) -> dict[str, Any]:
    """Return settings of a policy by name.

    Parameters
    ----------
    assignments : iterable of str
        ``KEY=VALUE`` each.

    Raises
    ------
    ValueError
        Where one sets nothing.
    """
    from lidarium.envs.settings.making import value_of

    options: dict[str, Any] = {}
    for assignment in assignments:
        key, equals, text = assignment.partition("=")
        if not equals or not key.strip():
            raise ValueError(f"--policy-set {assignment!r} sets nothing; want KEY=VALUE, such as kept=2.0")
        options[key.strip().replace("-", "_")] = value_of(text.strip())
    return options


def options_by_policy(assignments: Iterable[str], policies: Sequence[str]) -> dict[str, dict[str, Any]]:
    """Return settings of several policies, by the names of policy and setting.

    Parameters
    ----------
    assignments : iterable of str
        ``POLICY.KEY=VALUE`` each.
    policies : sequence of str
        Who may be set.

    Raises
    ------
    ValueError
        Where one sets nothing, or a policy that is not there.
    """
    options: dict[str, dict[str, Any]] = {}
    for assignment in assignments:
        name, dot, rest = assignment.partition("=")[0].rpartition(".")
        if not dot or name not in policies:
            raise ValueError(
                f"--policy-set {assignment!r} names no policy that is evaluated; want POLICY.KEY=VALUE with "
                f"one of {', '.join(policies)}"
            )
        options.setdefault(name, {}).update(policy_options([rest + assignment[len(name) + 1 + len(rest) :]]))
    return options
