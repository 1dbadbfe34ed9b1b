"""The speed from which a robot still stops before what is ahead of it."""

import math

import numpy as np
import pytest

from lidarium.envs.onboard.driving.safety_stop import (
    FORESIGHT_TIMES,
    LEAST_TEAMMATE_GAP,
    STANDSTILL,
    TEAMMATE_GAP,
    Bodies,
    Sensed,
    _gap_in_scan,
    _gap_to_teammates,
    safe_speed,
)
from lidarium.envs.simulation.people.population import no_people
from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.kernels.compilation import kernel

BEAMS = np.radians(np.linspace(-120.0, 120.0, 241))
UNIT = np.stack([np.cos(BEAMS), np.sin(BEAMS)])
RADIUS, HERE = 0.2, np.zeros(3)


def bodies_of(robots, knows_teammates=True):
    limits = np.array([0.5, 2.0, 1.0, 0.1])
    beams, radii, present = np.stack([UNIT] * robots), np.full(robots, RADIUS), np.ones(robots, np.uint8)
    return Bodies(beams, radii, limits, knows_teammates, present, FORESIGHT_TIMES)


def sensed_of(poses, ranges=None, contact=None):
    poses = np.asarray(poses, np.float64)
    robots = len(poses)
    scans = np.full((robots, len(BEAMS)), np.inf, np.float32)
    if ranges is not None:
        scans[0] = ranges
    contact = np.zeros((robots, robots), np.uint8) if contact is None else contact
    heard = np.tile(poses.ravel(), (robots, 1))
    return Sensed(poses, np.zeros((robots, 2)), scans, poses, contact, heard, no_people(robots))


@kernel
def speed_of(sensed, bodies, robot):
    return safe_speed(sensed, bodies, robot)


@pytest.mark.parametrize("seed", range(5))
def test_the_gap_in_a_scan_is_how_far_the_disc_can_be_pushed(seed):
    ranges = np.random.default_rng(seed).uniform(0.3, 3.0, len(BEAMS)).astype(np.float32)
    ranges[::7] = np.inf
    # The robot has moved on since the scan in the second case.
    pose = np.zeros(3) if seed % 2 else np.array([0.1, -0.05, 0.4])
    found = _gap_in_scan(ranges, UNIT, RADIUS, HERE, pose)
    hits = Transform(*pose).inverse().apply((ranges * UNIT)[:, np.isfinite(ranges)].T)

    def is_clear(way):
        return (np.hypot(hits[:, 0] - way, hits[:, 1]) > RADIUS).all()

    assert all(is_clear(way) for way in np.linspace(0.0, found - 1e-3, 200))
    assert not is_clear(found + 1e-3)


def test_nothing_ahead_is_no_limit():
    ranges = np.full(len(BEAMS), np.inf, np.float32)
    ranges[np.abs(BEAMS) > math.pi / 2] = 0.3
    assert _gap_in_scan(ranges, UNIT, RADIUS, HERE, HERE) == math.inf
    assert speed_of(sensed_of([(0, 0, 0)], ranges), bodies_of(1), 0) == math.inf


def test_a_robot_stops_before_a_wall():
    for distance in (0.25, 0.5, 2.0):
        ranges = (distance / np.maximum(np.cos(BEAMS), 1e-3)).astype(np.float32)
        speed = speed_of(sensed_of([(0, 0, 0)], ranges), bodies_of(1), 0)
        assert speed**2 / 2.0 == pytest.approx(distance - RADIUS - STANDSTILL, abs=2e-3)
    ranges[:] = RADIUS
    assert speed_of(sensed_of([(0, 0, 0)], ranges), bodies_of(1), 0) == 0.0


def test_a_teammate_ahead_is_kept_clear_of_in_any_direction():
    present, still = np.ones(2, np.uint8), np.zeros((2, 2))
    for heading in (0.0, 1.0, -2.5):
        ahead = (2.0 * math.cos(heading), 2.0 * math.sin(heading), 0.3)
        poses = np.array([(0.0, 0.0, heading), ahead])
        gap = _gap_to_teammates(0, poses, still, bodies_of(2), present)
        assert gap == pytest.approx(2.0 - 2 * RADIUS - TEAMMATE_GAP)
        poses[0, 2] += math.pi
        assert _gap_to_teammates(0, poses, still, bodies_of(2), present) == math.inf


def test_of_two_that_are_too_near_the_lower_number_may_pass():
    bodies, present, still = bodies_of(2), np.ones(2, np.uint8), np.zeros((2, 2))
    beside = 2 * RADIUS + LEAST_TEAMMATE_GAP + 0.002
    poses = np.array([(0.0, 0.0, 0.0), (0.01, beside, 0.0)])
    assert _gap_to_teammates(0, poses, still, bodies, present) == math.inf
    assert _gap_to_teammates(1, poses[::-1].copy(), still, bodies, present) == 0.0


def test_the_higher_number_foresees_who_crosses_its_path():
    bodies, present = bodies_of(2), np.ones(2, np.uint8)
    crossing = np.array([(1.5, -1.0, math.pi / 2), (0.0, 0.0, 0.0)])
    velocities = np.array([(0.8, 0.0), (0.3, 0.0)])
    assert _gap_to_teammates(1, crossing, velocities, bodies, present) < 1.5
    assert _gap_to_teammates(0, crossing[::-1].copy(), velocities[::-1].copy(), bodies, present) == math.inf


def test_who_is_heard_of_is_taken_to_stand_there():
    contact = np.array([[0, 1], [0, 0]], np.uint8)
    poses = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0)]
    known = speed_of(sensed_of(poses), bodies_of(2), 0)
    assert speed_of(sensed_of(poses, contact=contact), bodies_of(2, False), 0) == pytest.approx(known)
    assert speed_of(sensed_of(poses), bodies_of(2, False), 0) == math.inf
