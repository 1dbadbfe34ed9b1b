"""Robots as text for the physics."""

import math
import xml.etree.ElementTree as ElementTree

import pytest

from lidarium.envs.settings.robots import ROBOTS
from lidarium.envs.simulation.bullet.robot_text import urdf_of


@pytest.mark.parametrize("name", list(ROBOTS))
def test_a_robot_is_as_large_and_as_heavy_as_it_is(name):
    robot = ROBOTS[name]
    root = ElementTree.fromstring(urdf_of(robot))
    masses = {link.get("name"): float(link.find("inertial/mass").get("value")) for link in root.iter("link")}
    assert set(masses) == {"base", "left", "right", "casters"}
    assert (masses["base"], masses["left"]) == (robot.build.base_mass, robot.build.wheel_mass)
    cylinder = root.find("link[@name='base']/collision/geometry/cylinder")
    middle = float(root.find("link[@name='base']/collision/origin").get("xyz").split()[2])
    assert float(cylinder.get("radius")) == robot.radius
    assert middle + 0.5 * float(cylinder.get("length")) == pytest.approx(robot.height)


def test_wheels_stand_on_the_ground_as_far_apart_as_they_are():
    robot = ROBOTS["kobuki"]
    root = ElementTree.fromstring(urdf_of(robot))
    places = {
        joint.get("name"): [float(value) for value in joint.find("origin").get("xyz").split()]
        for joint in root.iter("joint")
    }
    assert places["left"][1] - places["right"][1] == pytest.approx(robot.wheel_base)
    assert places["left"][2] == places["right"][2] == robot.build.wheel_radius


def test_numbers_that_are_none_are_no_robot():
    with pytest.raises(ValueError, match="are no places"):
        urdf_of(_Bent(ROBOTS["kobuki"]))


class _Bent:
    """A robot whose wheels are nowhere."""

    wheel_base = math.nan

    def __init__(self, robot):
        self._robot = robot

    def __getattr__(self, name):
        return getattr(self._robot, name)
