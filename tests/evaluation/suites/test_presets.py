"""Presets run as other projects do."""

from dataclasses import replace

import pytest

from lidarium.evaluation.suites.campaign import run_trial
from lidarium.evaluation.suites.presets import PRESETS, preset_named, preset_suite


@pytest.mark.parametrize("name", PRESETS)
def test_a_preset_runs_and_has_the_figures_that_its_project_prints(name, shared_data):
    whole = preset_suite(name, ("nearest_frontier",), (0,), shared_data)
    short = replace(whole, floors=whole.floors[:1], variants={name: {**whole.variants[name], "horizon_s": 4.0}})
    line = run_trial(short, next(short.trials()))
    assert {figure for figure in preset_named(name).figures if figure not in line} == set()
    assert line["time_s"] <= 4.0 + 1e-6


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
    assert preset_suite("ariadne", ("random_walk",), (0,), None, ("apartment",)).floors == ("apartment",)
