"""Lidars that differ by robot, as settings."""

import json
import math
from dataclasses import asdict

import pytest

from lidarium.envs.settings.lidar import LIDARS, NOISE, Lidar
from lidarium.envs.settings.making import make_settings, set_values
from lidarium.evaluation.episodes.settings_identity import realism_of, settings_sha256

NEAR, FAR = Lidar(beams=91, range_max=2.0, field_of_view=math.pi), Lidar(beams=91, range_max=8.0, range_min=0.1)


def test_lidars_follow_each_other_and_begin_again():
    settings = make_settings(robots=3, lidar=[NEAR, FAR])
    assert settings.team_lidars == [NEAR, FAR, NEAR]
    assert make_settings(robots=2).team_lidars == [LIDARS["urg"]] * 2


def test_a_lidar_is_a_name_values_or_an_object():
    settings = make_settings(lidar=["urg", {"range_max": 8.0}, Lidar(noise_floor=0.1)])
    assert settings.lidars == (LIDARS["urg"], Lidar(range_max=8.0), Lidar(noise_floor=0.1))


def test_the_lidar_of_the_team_reaches_as_far_and_as_wide_as_any():
    lidar = make_settings(robots=2, lidar=[NEAR, FAR]).lidar
    assert (lidar.range_min, lidar.range_max, lidar.field_of_view) == (0.02, 8.0, math.radians(240.0))
    assert make_settings(robots=1, lidar=[NEAR, FAR]).lidar == NEAR
    noisy = make_settings(lidar=[NEAR, Lidar(beams=91, noise_share=0.02)])
    assert noisy.lidar.is_noisy
    assert not noisy.is_ideal


def test_equal_lidars_are_one():
    assert make_settings(lidar=["urg", Lidar()]) == make_settings()


def test_one_lidar_replaces_those_of_a_team():
    mixed = make_settings(lidar=[NEAR, FAR])
    assert make_settings(mixed, lidar="urg") == make_settings()
    assert make_settings(mixed, robots=5).lidars == (NEAR, FAR)


def test_noise_and_single_values_are_set_in_each_lidar():
    mixed = make_settings(robots=2, lidar=[NEAR, FAR])
    noisy = make_settings(mixed, noise="datasheet")
    assert [(each.noise_floor, each.noise_share) for each in noisy.team_lidars] == [NOISE["datasheet"]] * 2
    assert [each.range_max for each in noisy.team_lidars] == [2.0, 8.0]
    assert realism_of(make_settings(mixed, realism="lab")) == "lab"
    for fewer in (make_settings(mixed, assigned=["lidar.beams=45"]), set_values(mixed, {"lidar.beams": 45})):
        assert [(each.beams, each.range_max) for each in fewer.team_lidars] == [(45, 2.0), (45, 8.0)]


def test_settings_that_were_written_as_json_are_the_same():
    mixed = make_settings(robots=2, lidar=[NEAR, FAR])
    assert make_settings(**json.loads(json.dumps(asdict(mixed)))) == mixed


def test_the_order_of_lidars_belongs_to_the_identity_of_settings():
    hashes = {settings_sha256(make_settings(robots=2, lidar=lidars)) for lidars in ([NEAR, FAR], [FAR, NEAR], FAR)}
    assert len(hashes) == 3


@pytest.mark.parametrize(
    ("lidar", "message"),
    [
        (["urg", "lidar_360_6m"], r"beams of the lidars is \[727, 180\]; want the same for all robots of a team"),
        ([{}, {"height": 0.2}], r"height of the lidars is \[0.3, 0.2\]; want the same for all robots of a team"),
        (["urg", "ugr"], "unknown lidar 'ugr'; did you mean 'urg'"),
        (["urg", 3], "lidars has 3; want Lidar or its name"),
        (["urg", {"range": 3.0}], "Lidar: unknown setting 'range'"),
        (["urg", {"range_max": -1.0}], "range_max of the laser is -1.0; want a number above 0"),
        (3, "lidar is 3; want Lidar or its name"),
        ([], r"lidar is \[\]; want Lidar or its name"),
    ],
)
def test_bad_lidars_are_refused(lidar, message):
    with pytest.raises(ValueError, match=message):
        make_settings(lidar=lidar)
