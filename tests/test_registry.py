"""Registries: names, summaries, items that are imported when asked for."""

import subprocess
import sys

import pytest

from lidarium.registry import REGISTRIES, Registry, registry, unknown


@pytest.fixture
def shapes():
    made = Registry("shape")
    made.register("square", 4, "four corners")
    made.register("triangle", "math:tau", "by its module")
    return made


def test_an_item_is_found_by_its_name_and_imported_when_asked_for(shapes):
    import math

    assert shapes["square"] == 4
    assert shapes["triangle"] == math.tau
    assert list(shapes) == ["square", "triangle"]
    assert shapes.summaries == {"square": "four corners", "triangle": "by its module"}
    assert "circle" not in shapes
    assert shapes.get("circle") is None


def test_an_unknown_name_is_refused_with_the_nearest_one(shapes):
    with pytest.raises(ValueError, match=r"unknown shape 'squar'; did you mean 'square'\? \(known: square, triangle\)"):
        shapes["squar"]
    with pytest.raises(KeyError):
        shapes["squar"]
    assert unknown("shape", "zzz", []) == "unknown shape 'zzz' (known: none)"


def test_a_users_item_is_replaced_with_a_warning_and_its_name_is_free_again_when_it_is_unregistered(shapes):
    with pytest.warns(UserWarning, match="shape 'square' was registered before and is replaced"):
        shapes.register("square", 5, "another")
    assert shapes["square"] == 5
    assert shapes.summaries["square"] == "another"
    shapes.unregister("square")
    shapes.register("square", 6, "a third")
    assert shapes["square"] == 6
    with pytest.raises(ValueError, match="unknown shape 'cube'"):
        shapes.unregister("cube")


@pytest.mark.parametrize("kind", sorted(REGISTRIES))
def test_every_item_of_every_registry_can_be_made_and_has_a_summary_of_one_line(kind):
    entries = registry(kind)
    assert len(entries) > 0
    for name in entries:
        assert entries[name] is not None
        assert 0 < len(entries.summaries[name]) <= 110
        assert "\n" not in entries.summaries[name]


def test_kinds_that_are_not_there_are_refused():
    with pytest.raises(ValueError, match="unknown registry 'robots'; did you mean 'robot'"):
        registry("robots")


def test_naming_policies_and_localizers_imports_none_of_them():
    code = (
        "import sys; from lidarium.registry import registry; list(registry('policy'));"
        "list(registry('localizer')); slow = ('agents.srt', 'supervisor', '.slam');"
        "print([name for name in sys.modules if any(part in name for part in slow)])"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout.strip() == "[]"


def test_a_message_names_as_many_known_names_as_can_be_read():
    said = unknown("setting", "zz", [f"setting_{number}" for number in range(200)], 300)
    assert len(said) < 450
    assert said.endswith(" more)")
    assert "setting_0, setting_1, " in said
    assert unknown("setting", "zz", ["one", "two"]).endswith("(known: one, two)")
