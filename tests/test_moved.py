"""Old names of modules still work for one release, and warn."""

import importlib
import subprocess
import sys

import pytest

from lidarium.moved import MOVED, MOVED_NAMES, RENAMED, renamed_method


@pytest.mark.parametrize("old", sorted(MOVED))
def test_a_module_that_has_moved_is_found_by_its_old_name(old):
    sys.modules.pop(f"lidarium.{old}", None)
    with pytest.warns(DeprecationWarning, match=f"lidarium.{old} has moved to lidarium.{MOVED[old][0]}"):
        module = importlib.import_module(f"lidarium.{old}")
    for place in MOVED[old]:
        new = importlib.import_module(f"lidarium.{place}")
        names = [
            name
            for name, thing in vars(new).items()
            if getattr(thing, "__module__", "") == new.__name__ and not name.startswith("__")
        ]
        for name in names:
            assert getattr(module, name) is getattr(new, name)
    sys.modules.pop(f"lidarium.{old}", None)


@pytest.mark.parametrize(
    ("old", "name", "new"),
    [
        ("agents.policy", "make_policy", "agents.catalogue"),
        ("agents.frontier", "NearestFrontier", "agents.frontier_policies"),
        ("envs.onboard.perception", "Belief", "envs.onboard.belief"),
        ("envs.settings", "LIDARS", "envs.settings.lidar"),
        ("evaluation.truth", "truth_of", "evaluation.truth.true_map"),
        ("mapping.kernels", "vector_at", "mapping.kernels.views"),
        ("mapping.localization.slam", "Slam", "mapping.localization.slam.localizer"),
        ("envs.radio.exchange", "STATION_STREAM", "envs.radio.radio_links"),
        ("envs.simulation.kernels.motion", "distance_bound", "envs.simulation.kernels.contact"),
        ("evaluation.truth.map_counts", "COUNTED", "evaluation.truth.team_counts"),
        ("scripts.floors", "LASER_HEIGHT", "scripts.output.floor_files"),
        ("scripts.run", "NAMED_GIVEN_UP", "scripts.output.run_summary"),
    ],
)
def test_a_name_that_has_moved_is_found_where_it_was(old, name, new):
    assert f"{new}" in MOVED_NAMES[old]
    with pytest.warns(DeprecationWarning, match=f"lidarium.{old}.{name} has moved"):
        found = getattr(importlib.import_module(f"lidarium.{old}"), name)
    assert found is getattr(importlib.import_module(f"lidarium.{new}"), name)


@pytest.mark.parametrize(("module", "old"), [(module, old) for module in RENAMED for old in RENAMED[module]])
def test_a_name_that_has_changed_is_found_by_the_old_one(module, old):
    new = RENAMED[module][old]
    sys.modules.pop(f"lidarium.{module}", None) if module in MOVED else None
    with pytest.warns(DeprecationWarning, match=f"has moved to|is now called {new}"):
        found = getattr(importlib.import_module(f"lidarium.{module}"), old)
    places = MOVED.get(module) or MOVED_NAMES[module]
    assert any(found is getattr(importlib.import_module(f"lidarium.{place}"), new, None) for place in places)


def test_a_method_that_has_changed_is_found_by_the_old_name():
    class Sender:
        def send(self, what, *, twice=False):
            return what * (2 if twice else 1)

        tell = renamed_method("tell", "send")

    with pytest.warns(DeprecationWarning, match=r"Sender\.tell is now called send"):
        assert Sender().tell("a", twice=True) == "aa"


def test_what_never_was_is_still_not_found():
    with pytest.raises(ModuleNotFoundError, match=r"lidarium\.nothing"):
        importlib.import_module("lidarium.nothing")
    with pytest.raises(ImportError, match="cannot import name 'nothing'"):
        exec("from lidarium.mapping.kernels import nothing")


@pytest.mark.parametrize("module", sorted(RENAMED.keys() - MOVED.keys()))
def test_a_module_with_changed_names_lacks_what_it_never_had(module):
    assert not hasattr(importlib.import_module(f"lidarium.{module}"), "nothing")


def test_the_warning_names_the_line_that_imports(tmp_path):
    script = tmp_path / "old.py"
    script.write_text("import lidarium\nfrom lidarium.mapping.rigid import Transform\nprint(Transform())\n")
    result = subprocess.run(
        [sys.executable, "-W", "always", str(script)], capture_output=True, text=True, check=True
    )
    assert f"{script}:2: DeprecationWarning: lidarium.mapping.rigid has moved" in result.stderr
