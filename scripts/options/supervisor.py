"""Settings of the supervisor on the command line: ``--supervisor.KEY VALUE``."""

from collections.abc import Iterable, Sequence
from typing import Any

PREFIX = "--supervisor."


def gathered(words: Sequence[str]) -> list[str]:
    """Return a command line in which all settings of the supervisor are one option.

    ``--supervisor.KEY VALUE`` and ``--supervisor.KEY=VALUE`` become ``--supervisor KEY=VALUE ...`` at its
    end; dashes in a key are underscores.

    Raises
    ------
    ValueError
        Where a setting has no value.
    """
    rest: list[str] = []
    found: list[str] = []
    left = iter(words)
    for word in left:
        if not word.startswith(PREFIX):
            rest.append(word)
            continue
        key, equals, value = word.removeprefix(PREFIX).partition("=")
        if not equals:
            value = next(left, "--")
            if value.startswith("--"):
                raise ValueError(f"{word} has no value; want {word} VALUE")
        found.append(f"{key.replace('-', '_')}={value}")
    return [*rest, "--supervisor", *found] if found else rest


def supervisor_options(assignments: Iterable[str]) -> dict[str, Any]:
    """Return settings of the supervisor by name.

    Parameters
    ----------
    assignments : iterable of str
        ``KEY=VALUE`` each, as ``lidarium show supervisor`` lists the keys.

    Raises
    ------
    ValueError
        Where there is no such setting, or it cannot have such a value; the message suggests the nearest name.
    """
    from dataclasses import fields

    from lidarium.agents.supervisor.settings import SupervisorSettings
    from lidarium.envs.settings.making import value_of
    from lidarium.registry import unknown

    known = [each.name for each in fields(SupervisorSettings)]
    options: dict[str, Any] = {}
    for assignment in assignments:
        key, equals, text = assignment.partition("=")
        if not equals:
            raise ValueError(f"--supervisor {assignment!r} sets nothing; want KEY=VALUE, such as period_s=5")
        if key not in known:
            raise ValueError(unknown("setting of the supervisor", key, known))
        options[key] = value_of(text.strip())
    SupervisorSettings(**options)
    return options


def is_supervised(name: str) -> bool:
    """Return whether a policy is led by a supervisor whose settings can be set."""
    from lidarium.agents import make_policy
    from lidarium.agents.supervisor.policy import Supervised

    return isinstance(make_policy(name), Supervised)


def check_supervised(name: str) -> None:
    """Check that a policy is led by a supervisor whose settings can be set.

    Raises
    ------
    ValueError
        Where it is not; the policies that are, are named.
    """
    from lidarium.agents import policy_names

    if not is_supervised(name):
        led = ", ".join(filter(_can_be_led, policy_names()))
        raise ValueError(
            f"settings of the supervisor are given, and policy {name!r} has none; want one of {led}"
        )


def _can_be_led(name: str) -> bool:
    """Return whether a policy is led by a supervisor, and can be made here."""
    try:
        return is_supervised(name)
    except ValueError:  # weights of a network are missing or damaged
        return False
