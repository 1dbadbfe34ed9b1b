"""Where a laser is on its robot, by chains of transforms."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from lidarium.mapping.files.bags.frames import Frames


def transform(place=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0), degrees=0.0):
    """Return a transform as ROS has it: moved, and turned about an axis."""
    half = 0.5 * math.radians(degrees)
    x, y, z = math.sin(half) * np.array(axis)
    return SimpleNamespace(
        translation=SimpleNamespace(**dict(zip("xyz", place, strict=True))),
        rotation=SimpleNamespace(x=x, y=y, z=z, w=math.cos(half)),
    )


def frames(*links):
    found = Frames()
    for parent, child, pose, is_static in links:
        found.note(parent, child, pose, is_static=is_static)
    return found


X = (1.0, 0.0, 0.0)


def test_transforms_are_multiplied_from_the_body_to_the_laser():
    chain = frames(
        ("base_link", "laser", transform((0.2, 0.0, 0.1), degrees=90.0), True),
        ("base_footprint", "base_link", transform((0.0, 0.1, 0.3), degrees=90.0), True),
        ("odom", "base_footprint", transform((9.0, 9.0, 0.0)), False),
    )
    found = chain.mounting("base_footprint", "laser")
    assert found.pose == pytest.approx([0.0, 0.3, math.pi])
    assert not found.is_hanging


def test_the_chain_may_lead_up_from_the_body_and_down_again():
    chain = frames(
        ("top", "base_link", transform((0.0, 0.0, 0.2), degrees=90.0), True),
        ("top", "laser", transform((0.0, 0.5, 0.0)), True),
    )
    found = chain.mounting("base_link", "laser")
    assert found.pose == pytest.approx([0.5, 0.0, -math.pi / 2])


def test_a_laser_upside_down_hangs_and_still_looks_ahead():
    found = frames(("base", "laser", transform((0.2, 0.0, 0.5), X, 180.0), True)).mounting("base", "laser")
    assert found.is_hanging
    assert found.pose == pytest.approx([0.2, 0.0, 0.0])


def test_two_turns_by_which_a_laser_is_upright_again_cancel():
    chain = frames(
        ("base", "plate", transform(axis=X, degrees=180.0), True),
        ("plate", "laser", transform(axis=X, degrees=180.0), True),
    )
    assert not chain.mounting("base", "laser").is_hanging


def test_a_laser_that_leans_is_refused():
    with pytest.raises(ValueError, match=r"the laser \(frame laser\) leans by 30 degrees on the robot"):
        frames(("base", "laser", transform(axis=X, degrees=30.0), True)).mounting("base", "laser")
    assert frames(("base", "laser", transform(axis=X, degrees=2.0), True)).mounting("base", "laser") is not None


def test_a_laser_that_moves_on_its_robot_is_refused():
    links = [("base", "laser", transform((0.1, 0.0, 0.2), degrees=each), False) for each in (0.0, 0.5, -0.5)]
    assert frames(*links).mounting("base", "laser").pose == pytest.approx([0.1, 0.0, 0.0])
    links.append(("base", "laser", transform((0.1, 0.0, 0.2), degrees=40.0), False))
    with pytest.raises(ValueError, match=r"frame laser moves in base by 0\.00 m, 40 degrees"):
        frames(*links).mounting("base", "laser")


def test_without_a_chain_or_by_the_ground_alone_there_is_no_mounting():
    chain = frames(
        ("odom", "base", transform((1.0, 0.0, 0.0)), False),
        ("odom", "laser", transform((1.0, 0.0, 0.0)), False),
        ("a", "b", transform(), True),
        ("b", "a", transform(), True),
    )
    assert chain.mounting("base", "laser") is None
    assert chain.mounting("base", "nowhere") is None
    assert chain.mounting("a", "b") is not None


def test_the_body_is_the_frame_to_which_a_laser_is_fixed_at_last():
    chain = frames(
        ("odom", "base_footprint", transform(), False),
        ("base_footprint", "base_link", transform(), True),
        ("base_link", "laser", transform(), True),
    )
    assert chain.body("laser") == "base_footprint"
    assert chain.body("alone") == "alone"


def test_transforms_that_are_not_finite_are_refused():
    with pytest.raises(ValueError, match="a transform between frames is not finite"):
        frames(("base", "laser", transform((math.nan, 0.0, 0.0)), True))
