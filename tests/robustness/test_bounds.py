"""Every number of the settings has a type and bounds, the same for all who give it."""

import math
import random
import re
from dataclasses import fields, is_dataclass

import numpy as np
import pytest
from robustness.extremes import _rows, _step

from lidarium.envs.settings.exploration import ExplorationSettings, localizer_settings
from lidarium.envs.settings.lidar import Lidar
from lidarium.envs.settings.making import make_settings
from lidarium.envs.settings.odometry import OdometrySettings
from lidarium.envs.settings.robots import Robot
from lidarium.envs.settings.table import settings_table
from lidarium.evaluation.suites.suite import suite_of
from lidarium.mapping.geometry.bounds import UNBOUNDED, rules_of

NAMES = [row.name for row in settings_table() if row.bounds]


def nested(name, value):
    """Options that set one value: those of parts as mappings."""
    for part in reversed(name.split(".")):
        value = {part: value}
    return value


def test_every_number_of_the_table_has_bounds_of_its_own():
    for row in settings_table():
        is_number = isinstance(row.default, int | float) and not isinstance(row.default, bool)
        assert bool(row.bounds) or not is_number, row.name
        assert f"{UNBOUNDED:g}" not in row.bounds, row.name


@pytest.mark.parametrize("localization", ["slam", "splines_ekf"])
def test_every_number_of_a_localizer_has_bounds_of_its_own(localization):
    def check(settings):
        for name, rule in rules_of(type(settings)).items():
            value = getattr(settings, name)
            if is_dataclass(value):
                check(value)
            elif rule.kind in (int, float):
                assert rule.bounds.maximum < UNBOUNDED, f"{type(settings).__name__}.{name}"

    check(localizer_settings(localization, {}))


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("value", [1e300, -1e300, math.nan, 10**400])
def test_a_number_beyond_is_refused_alike_by_name_and_by_assignment(name, value):
    last, options = name.rpartition(".")[2], nested(name, value)
    with pytest.raises(ValueError, match=rf"{last}\b.*; want"):
        make_settings(**options)
    with pytest.raises(ValueError, match=rf"{last}\b.*; want"):
        make_settings(assigned=[f"{name}={value}"])
    with pytest.raises(ValueError, match=last):
        suite_of({"policies": ["random_walk"], "floors": ["apartment"], "settings": {**options, "x": 1}})


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("value", ["x", [1.0], {}, True, 1j])
def test_a_value_of_another_type_is_refused_with_what_to_want(name, value):
    with pytest.raises(ValueError, match=name.rpartition(".")[2]) as caught:
        make_settings(**nested(name, value))
    assert len(str(caught.value)) < 300


def test_numbers_of_numpy_are_numbers():
    assert Lidar(beams=np.int64(90), range_max=np.float32(4.0)).beams == 90
    assert Robot(radius=np.float64(0.2)).radius == 0.2
    assert OdometrySettings(counts_ticks=np.bool_(True)).counts_ticks


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"lidar": {"range_max": 200.0}, "resolution": 0.01, "raster_resolution": 0.01}, "lidar.range_max"),
        ({"robots": 64, "lidar": {"beams": 16_384}}, r"robots \* lidar.beams"),
        ({"robots": 64, "map_cells": 4096}, "observed"),
        (
            {
                "robot": {"max_speed": 50.0, "cruise_speed": 1.0},
                "time_step": 10.0,
                "decision_period_s": 20.0,
                "raster_resolution": 0.005,
            },
            "pieces",
        ),
        ({"robot": {"radius": 10.0}, "raster_resolution": 0.005, "robots": 64}, "bodies"),
        ({"horizon_s": 1e8, "time_step": 1e-4, "decision_period_s": 100.0}, "decision_period_s"),
    ],
)
def test_settings_that_are_each_within_bounds_may_ask_for_too_much_together(options, words):
    with pytest.raises(ValueError, match=rf"{words}.*want at most.*choose"):
        make_settings(**options)


@pytest.mark.parametrize("row", _rows(ExplorationSettings()), ids=lambda row: row.name)
@pytest.mark.parametrize("end", ["minimum", "maximum"])
def test_the_ends_of_each_bound_can_be_simulated_or_are_refused(row, end):
    """One at a time, all else usual; a step takes a moment, and what is observed are numbers."""
    value = getattr(row.bounds, end)
    value = round(value) if row.is_whole else value
    try:
        _step(make_settings(**nested(row.name, value)), random.Random(0))
    except ValueError as error:
        assert re.search("want|do not fit", str(error))  # noqa: PT017


def test_settings_of_records_are_those_of_the_class():
    assert {each.name for each in fields(ExplorationSettings)} == set(rules_of(ExplorationSettings))
