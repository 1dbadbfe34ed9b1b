"""Every knob is checked when it is set, and the message names it, its value and what would be right."""

import json
import math
import pickle
from dataclasses import FrozenInstanceError, asdict, replace

import numpy as np
import pytest

from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.envs.settings.lidar import LIDARS, NOISE, Lidar
from lidarium.envs.settings.making import make_settings
from lidarium.envs.settings.robots import ROBOTS
from lidarium.mapping.grids.occupancy import OccupancySettings


@pytest.mark.parametrize(
    ("option", "value", "wanted"),
    [
        ("robots", 0, "1 to 64"),
        ("robots", 65, "1 to 64"),
        ("robots", -1, "1 to 64"),
        ("robots", 2.0, "1 to 64"),
        ("robots", "3", "1 to 64"),
        ("localization", "gps", "truth"),
        ("backend", "gazebo", "kinematic"),
        ("time_step", 0.0, "from 0.0001 to 10"),
        ("time_step", math.inf, "from 0.0001 to 10"),
        ("time_step", math.nan, "from 0.0001 to 10"),
        ("horizon_s", 0.0, "or None"),
        ("horizon_s", math.inf, "or None"),
        ("horizon_s", -5.0, "or None"),
        ("horizon_s", math.nan, "or None"),
        ("stop_coverage", 0.0, "or None"),
        ("stop_coverage", 1.01, "or None"),
        ("map_cells", 255, "even number"),
        ("map_cells", 0, "from 2 to 4,096"),
        ("raster_resolution", 0.0, "from 0.005 to 10"),
        ("raster_resolution", 0.03, "whole multiple"),
        ("decision_period_s", 0.05, "time step"),
        ("decision_period_s", math.nan, "above 0"),
        ("threads", 0, "from 1 to"),
        ("observe", (), "one or more of scan"),
        ("observe", "scan", "list or tuple"),
        ("observe", 3, "list or tuple"),
        ("observe", ("scan", "map", "scan"), "'scan' once"),
        ("egocentric_cells", 63, "even number"),
        ("egocentric_cells", 0, "from 2 to 1,024"),
        ("egocentric_cells", 2000, "from 2 to 1,024"),
        ("egocentric_cells", 64.0, "whole number"),
        ("egocentric_scales", (), "one or more"),
        ("egocentric_scales", 4, "list or tuple"),
        ("egocentric_scales", (1, 0), "1 to 64"),
        ("egocentric_scales", (65,), "1 to 64"),
        ("egocentric_scales", (1.0,), "whole numbers"),
        ("egocentric_scales", (True,), "whole numbers"),
    ],
)
def test_a_bad_value_is_refused_with_its_name_its_value_and_the_cure(option, value, wanted):
    with pytest.raises(ValueError, match=wanted) as caught:
        ExplorationSettings(**{option: value})
    assert option in str(caught.value)
    assert str(value) in str(caught.value)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"robot": "kobukki"}, "unknown robot 'kobukki'; did you mean 'kobuki'"),
        ({"lidar": "sick"}, "unknown lidar 'sick'.*known: urg"),
        ({"noise": "loud"}, "unknown noise 'loud'.*known: none, datasheet, thesis"),
        ({"resolution": 0.03}, "whole multiple"),
        ({"resolution": -0.05}, "resolution"),
        ({"max_cycles": 0}, "max_cycles is 0"),
    ],
)
def test_a_bad_short_option_is_refused_with_what_is_known(options, words):
    with pytest.raises(ValueError, match=words):
        make_settings(**options)


@pytest.mark.parametrize(
    ("name", "meant"), [("scann", "scan"), ("egocentric", "egocentric_map"), ("speed", "pose"), (7, None)]
)
def test_an_unknown_observation_is_refused_with_the_nearest_name(name, meant):
    with pytest.raises(ValueError, match="observe has an unknown name") as caught:
        make_settings(observe=["pose", name])
    assert repr(name) in str(caught.value)
    assert ("did you mean" in str(caught.value)) == (meant is not None)
    assert meant is None or f"did you mean {meant!r}" in str(caught.value)
    assert "known: scan, pose, velocity, bumper, map, egocentric_map" in str(caught.value)


def test_lists_of_names_and_scales_become_tuples():
    made = make_settings(observe=["map", "scan"], egocentric_scales=[np.int64(2), 8])
    assert made.observe == ("scan", "map")
    assert made.egocentric_scales == (2, 8)
    assert json.loads(json.dumps(asdict(made)))["egocentric_scales"] == [2, 8]
    assert make_settings(**{name: getattr(made, name) for name in ("observe", "egocentric_scales")}) == made
    assert hash(made) == hash(replace(made))


def test_an_unknown_option_is_a_type_error_that_lists_the_known_ones():
    with pytest.raises(
        TypeError,
        match=r"unknown option 'robotss'; did you mean 'robots'.*max_cycles.*noise.*resolution.*robots",
    ):
        make_settings(robotss=3)


def test_short_options_name_robots_lidars_noise_resolution_and_cycles():
    made = make_settings(
        robots=2, robot="pioneer", lidar="lidar_360_6m", noise="thesis", resolution=0.025, max_cycles=50
    )
    assert made.robot is ROBOTS["pioneer"]
    assert made.lidar == replace(LIDARS["lidar_360_6m"], noise_floor=0.03, noise_share=0.0)
    assert made.occupancy.resolution == 0.025
    assert made.horizon_steps == 50
    assert made.agents == ["robot_0", "robot_1"]


@pytest.mark.parametrize("cycles", [1, 7, 333])
@pytest.mark.parametrize("time_step", [0.1, 0.05, 1.0 / 3.0])
def test_max_cycles_are_steps_whatever_the_time_step(cycles, time_step):
    assert make_settings(max_cycles=cycles, time_step=time_step).horizon_steps == cycles


def test_options_start_from_given_settings_and_leave_them_as_they_are():
    base = ExplorationSettings(robots=5, lidar=Lidar(beams=30), occupancy=OccupancySettings(hit=1.0))
    made = make_settings(base, noise="datasheet", resolution=0.1)
    assert (made.robots, made.lidar.beams, made.occupancy.hit, made.occupancy.resolution) == (5, 30, 1.0, 0.1)
    assert (made.lidar.noise_floor, made.lidar.noise_share) == NOISE["datasheet"]
    assert base.lidar.noise_floor == 0.0
    assert base.occupancy.resolution == 0.05


def test_settings_are_frozen_comparable_and_picklable():
    made = ExplorationSettings(robots=2)
    with pytest.raises(FrozenInstanceError):
        made.robots = 3  # type: ignore[misc]
    assert pickle.loads(pickle.dumps(made)) == made
    assert made != ExplorationSettings(robots=3)


def test_no_horizon_and_no_stop_at_coverage_are_none():
    made = ExplorationSettings(horizon_s=None, stop_coverage=None)
    assert made.horizon_steps is None
    assert ExplorationSettings().horizon_steps == 6000
    assert ExplorationSettings().decision_steps == 20


def test_the_presets_are_those_of_the_data_sheets():
    urg = LIDARS["urg"]
    assert (urg.beams, urg.range_min, urg.range_max) == (727, 0.02, 5.6)
    assert math.degrees(urg.field_of_view) == pytest.approx(240.0)
    kobuki, pioneer = ROBOTS["kobuki"], ROBOTS["pioneer"]
    assert (2 * kobuki.radius, kobuki.height, kobuki.cruise_speed, kobuki.max_speed) == (
        0.36,
        0.52,
        0.33,
        0.77,
    )
    assert (pioneer.radius, pioneer.max_speed) == (0.267, 1.2)
    assert ROBOTS["service"].radius == 0.30
    assert 1.0 <= ROBOTS["service"].height <= 1.5
    assert NOISE["datasheet"] == (0.01, 0.01)
    assert NOISE["thesis"] == (0.03, 0.0)
    assert all(lidar.is_full_circle for name, lidar in LIDARS.items() if "360" in name)
