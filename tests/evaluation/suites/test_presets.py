"""Presets run as other projects do."""

from dataclasses import replace
from functools import cache

import pytest

from lidarium.evaluation.episodes.stop_rules import stop_rule_of
from lidarium.evaluation.suites.campaign import run_trial
from lidarium.evaluation.suites.presets import PRESETS, preset_named, preset_suite


def first_floor(whole, name, horizon_s):
    """Return a preset's suite on its first floor, for so long [s]."""
    starts = {floor: teams for floor, teams in whole.starts.items() if floor == whole.floors[0]}
    settings = {**whole.variants[name], "horizon_s": horizon_s}
    return replace(whole, floors=whole.floors[:1], starts=starts, variants={name: settings})


@pytest.fixture(scope="module")
def ran(shared_data):
    """Returns a preset's suite, and the line of two seconds on its first floor."""

    @cache
    def run(name):
        whole = preset_suite(name, ("nearest_frontier",), (0,), shared_data)
        short = first_floor(whole, name, 2.0)
        return whole, run_trial(short, next(short.trials()))

    return run


@pytest.mark.parametrize("name", PRESETS)
def test_a_preset_runs_and_has_the_figures_that_its_project_prints(name, ran):
    _, line = ran(name)
    assert {figure for figure in preset_named(name).figures if figure not in line} == set()
    assert 0.0 < line["time_s"] <= 2.0 + 1e-6


def test_presets_without_files_have_floors_of_the_package():
    for name, preset in PRESETS.items():
        if preset.floors:
            assert preset_suite(name, ("random_walk",), (0,)).floors == preset.floors
        else:
            with pytest.raises(ValueError, match="give --data, or --floors"):
                preset_suite(name, ("random_walk",), (0,))


def test_unknown_presets_and_empty_folders_are_refused(tmp_path):
    with pytest.raises(ValueError, match="did you mean 'ariadne'"):
        preset_named("ariadn")
    with pytest.raises(ValueError, match="there are none below"):
        preset_suite("ariadne", ("random_walk",), (0,), tmp_path)
    assert preset_suite("ariadne", ("nearest_node",), (0,), None, ("apartment",)).floors == ("apartment",)


def test_robots_start_at_the_marks_or_starts_of_the_projects_maps(ran):
    import cv2

    for name, side, grey in (("dare", 0.2, 208), ("ariadne", 0.1, 203), ("ir2", 0.1, 203), ("marvel", 0.1, 203)):
        whole, line = ran(name)
        (x, y, _), *others = line["starts"]
        pixels = cv2.imread(whole.floors[0], cv2.IMREAD_GRAYSCALE)
        assert abs(int(pixels[int(len(pixels) - y / side), int(x / side)]) - grey) <= 1, name
        assert all(1.0 <= ((x - a) ** 2 + (y - b) ** 2) ** 0.5 <= 9.0 for a, b, _ in others)
        assert len(others) == whole.robots[0] - 1


def test_ariadnes_maps_are_in_its_order_and_mapexs_starts_are_its_own(ran):
    floors = ran("ariadne")[0].floors
    assert [floor.rpartition("/")[2] for floor in floors[:2]] == ["img_9999.png", "img_9998.png"]
    assert len(floors) == 100
    starts = ran("mapex")[0].starts
    assert sum(map(len, starts.values())) == 22  # of 24 one is in a wall, and one outside of the building
    (outside,) = [floor for floor in starts if floor.endswith("50052750.png")]
    assert [(round(x, 2), round(y, 2)) for ((x, y, _),) in starts[outside]] == [(1.55, 63.65), (41.35, 34.95)]


def test_ir2_ends_after_fewer_decisions_with_four_robots():
    stop = PRESETS["ir2"].stop
    assert [stop_rule_of(stop, robots).decisions for robots in (4, 5)] == [196, 384]
    with pytest.raises(ValueError, match="without an entry for 3 robots"):
        stop_rule_of(stop, 3)


def test_policies_that_a_level_does_not_carry_out_are_refused(shared_data):
    with pytest.raises(ValueError, match="decides at the level 'velocity', which level 'graph'"):
        preset_suite("dare", ("srt",), (0,), shared_data)
