"""The table of all settings, made from their declarations."""

import inspect
import re
from collections.abc import Iterator
from dataclasses import dataclass, fields, is_dataclass, replace
from typing import Any

from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.mapping.geometry.bounds import rules_of


@dataclass(frozen=True, slots=True)
class _Setting:
    """A setting.

    Attributes
    ----------
    name : str
        Its name, with those of its parts: ``reward.time``.
    kind : str
        Its type as its class documents it.
    default : object
        Its default.
    summary : str
        Description, with the unit.
    bounds : str
        Valid interval; empty if the setting is not a number.
    """

    name: str
    kind: str
    default: Any
    summary: str
    bounds: str = ""


def settings_table(settings: Any = None, prefix: str = "") -> Iterator[_Setting]:  # noqa: ANN401
    """Yield every setting in the order of its declaration; those of a part follow under its name."""
    settings = ExplorationSettings() if settings is None else settings
    kind: Any = type(settings)
    documented, rules = _documented_attributes(kind), rules_of(kind)
    for each in fields(settings):
        value = getattr(settings, each.name)
        if is_dataclass(value):
            declared = rules[each.name].inner
            for row in settings_table(value, f"{prefix}{each.name}."):
                own = declared.get(row.name.rpartition(".")[2])
                yield row if own is None else replace(row, bounds=own.interval)
        else:
            kind, summary = documented[each.name]
            rule = rules[each.name]
            bounds = rule.bounds.interval if rule.kind in (int, float) else ""
            yield _Setting(f"{prefix}{each.name}", kind, value, summary, bounds)


def _documented_attributes(kind: type) -> dict[str, tuple[str, str]]:
    """Return the type and description of each attribute in the docstrings of a class and its bases."""
    found: dict[str, tuple[str, str]] = {}
    for each in reversed(kind.__mro__):
        text = inspect.cleandoc(each.__doc__ or "")
        section = re.search(r"^Attributes\n-+\n(.*?)(?=^\w[^\n]*\n-{3,}\n|\Z)", text, re.DOTALL | re.MULTILINE)
        entries = re.finditer(
            r"^(\S[^\n]*) : ([^\n]*)\n((?:[ ]+[^\n]*\n?|\n)*)", section[1] if section else "", re.MULTILINE
        )
        for entry in entries:
            for name in entry[1].split(", "):
                found[name] = (entry[2].partition(", default ")[0], " ".join(entry[3].split()))
    return found


def markdown_table(settings: Any = None, prefix: str = "") -> str:  # noqa: ANN401
    """Return the table of all settings, or of those of a part, as Markdown."""
    rows = [
        f"| `{row.name}` | {row.kind} | `{_shown(row.default)}` | {row.bounds} | {row.summary} |"
        for row in settings_table(settings, prefix)
    ]
    return "\n".join(["| setting | type | default | bounds | what it is |", "|---|---|---|---|---|", *rows]) + "\n"


def _shown(value: Any) -> str:  # noqa: ANN401
    if isinstance(value, float):
        return f"{value:.6g}"
    return str(value)
