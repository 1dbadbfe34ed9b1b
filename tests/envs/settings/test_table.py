"""The table of settings is made from their declarations, and has all of them."""

from dataclasses import fields, is_dataclass

from lidarium.envs.settings import ExplorationSettings
from lidarium.envs.settings.making import assign
from lidarium.envs.settings.table import markdown_table, settings_table


def names_of(part, prefix=""):
    for each in fields(part):
        value = getattr(part, each.name)
        yield from (names_of(value, f"{prefix}{each.name}.") if is_dataclass(value) else [f"{prefix}{each.name}"])


def test_every_setting_is_documented_with_its_type():
    rows = list(settings_table())
    assert [row.name for row in rows] == list(names_of(ExplorationSettings()))
    assert all(row.kind and row.summary.endswith(".") for row in rows)


def test_every_name_of_the_table_can_be_assigned():
    defaults = ExplorationSettings()
    for row in settings_table():
        if isinstance(row.default, bool):
            assert assign(defaults, [f"{row.name}={str(row.default).lower()}"]) == defaults
        elif isinstance(row.default, int | float):
            assert assign(defaults, [f"{row.name}={row.default!r}"]) == defaults
        elif row.default is None and row.name != "localizer":
            assert assign(defaults, [f"{row.name}=none"]) == defaults


def test_the_markdown_has_a_line_for_each():
    lines = markdown_table().splitlines()
    assert len(lines) == 2 + len(list(settings_table()))
    assert any(line.startswith("| `reward.time` | float | `0.01` |") for line in lines)
