"""Settings from tables of files and from assignments of the command line."""

import json
from dataclasses import asdict

import pytest

from lidarium.envs.settings import ExplorationSettings, make_settings
from lidarium.envs.settings.battery import BATTERIES
from lidarium.envs.settings.lidar import Lidar
from lidarium.envs.settings.making import assign
from lidarium.evaluation.episodes.settings_identity import settings_sha256
from lidarium.mapping.localization.settings import SlamSettings


def test_parts_are_given_by_name_by_value_or_by_a_mapping():
    by_mapping = make_settings(reward={"time": 0.5}, radio={"kind": "range", "reach": 3.0})
    assert (by_mapping.reward.time, by_mapping.reward.area) == (0.5, 1.0)
    assert (by_mapping.radio.kind, by_mapping.radio.reach) == ("range", 3.0)
    assert make_settings(radio="signal").radio.kind == "signal"


def test_a_realism_leaves_alone_what_is_given():
    noisy, other = {"noise_floor": 0.5}, Lidar(noise_floor=0.2)
    for lidar, expected in ((noisy, 0.5), (other, 0.2), ({"noise_floor": 0.0}, 0.0), ({"beams": 180}, 0.01)):
        assert make_settings(realism="lab", lidar=lidar).lidar.noise_floor == expected
        assert make_settings(realism="lab", noise="none", lidar=lidar).lidar.noise_floor == 0.0
    assert make_settings(realism="ideal", lidar=other).lidar.noise_floor == 0.2
    assert make_settings(make_settings(lidar=other), realism="ideal").lidar.noise_floor == 0.0
    lidars = make_settings(robots=2, realism="lab", lidar=[noisy, {}]).lidars
    assert [each.noise_floor for each in lidars] == [0.5, 0.01]
    assert make_settings(realism="fast", occupancy={"resolution": 0.05}).occupancy.resolution == 0.05
    with pytest.raises(ValueError, match=r"resolution is 0\.05 and occupancy has a resolution of 0\.1; want one"):
        make_settings(resolution=0.05, occupancy={"resolution": 0.1})


def test_what_json_holds_of_settings_makes_the_same_settings():
    made = make_settings(
        realism="field", localizer={"matching": {"points": 300}}, reward={"more": {"turning": -0.1}}, robots=2
    )
    again = make_settings(**json.loads(json.dumps(asdict(made))))
    assert again == made
    assert hash(again) == hash(made)
    assert settings_sha256(again) == settings_sha256(made)


def test_a_localizer_has_settings_of_its_own():
    made = make_settings(localization="slam", localizer={"matching": {"points": 200}})
    assert isinstance(made.localizer, SlamSettings)
    assert made.localizer.matching.points == 200
    assert made.localizer.closures == SlamSettings().closures


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"localizer": {"points": 3}}, "localization 'truth' has no settings"),
        (
            {"localization": "slam", "localizer": {"dots": 3}},
            "settings of localizer 'slam' cannot be used.*dots",
        ),
        ({"localization": "slam", "localizer": 7}, "localizer is 7; want SlamSettings"),
        ({"reward": {"more": {"turning": "much"}}}, "weight turning of the reward is 'much'"),
        ({"backend": "dream"}, "backend is 'dream'; want one of kinematic"),
    ],
)
def test_bad_parts_are_refused_with_a_reason(options, message):
    with pytest.raises(ValueError, match=message):
        make_settings(**options)


def test_single_values_are_assigned_by_their_names():
    made = assign(
        ExplorationSettings(),
        [
            "reward.time=0.25",
            "robot=pioneer",
            "robot.radius=0.2",
            "horizon_s=none",
            "localization=splines",
            "localizer.particles=50",
            'observe=["pose", "scan"]',
        ],
    )
    assert (made.reward.time, made.robot.radius, made.robot.max_speed) == (0.25, 0.2, 1.2)
    assert made.horizon_s is None
    assert made.localizer.particles == 50
    assert made.observe == ("scan", "pose")
    assert make_settings(assigned=["reward.time=0.25"]).reward.time == 0.25


@pytest.mark.parametrize(
    ("assignment", "message"),
    [
        ("reward", "'reward' sets nothing; want NAME=VALUE"),
        ("reward.tme=1", "'reward.tme' is no setting: unknown setting 'tme'; did you mean 'time'"),
        ("speed=1", "'speed' is no setting"),
        ("robots=1.5", "robots is 1.5"),
        ("reward.time=inf", "time of the reward is inf"),
        ("localizer.particles=5", "localization 'truth' has no settings"),
    ],
)
def test_bad_assignments_are_refused_with_the_cure(assignment, message):
    with pytest.raises(ValueError, match=message):
        assign(ExplorationSettings(), [assignment])


def test_settings_without_new_parts_keep_the_hash_of_older_records():
    assert settings_sha256(ExplorationSettings()) == (
        "29aa8ba6befade6f28ca824d3f7a82bea9e057c5d83f03c51901b1d1ee1306a7"
    )


def test_none_is_a_name_where_there_is_one_and_nothing_elsewhere():
    assigned = ["radio=none", "battery=none", "camera=none", "horizon_s=none"]
    settings = make_settings(assigned=assigned)
    assert settings.radio.kind == "none"
    assert settings.battery == BATTERIES["none"]
    assert (settings.camera, settings.horizon_s) == (None, None)
