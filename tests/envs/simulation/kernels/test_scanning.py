"""A scan is true ranges, disturbed as the sensor does, with what is invalid."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scored_halls import hall, tables_of

from lidarium.envs.settings.faults import Fault, FaultSettings
from lidarium.envs.settings.lidar import Lidar
from lidarium.envs.settings.robots import ROBOTS
from lidarium.envs.simulation.kernels.scanning import RANGE_GAP
from lidarium.envs.simulation.kernels.stepping import disturb_scan
from lidarium.envs.simulation.kinematic_world import KinematicWorld

KOBUKI = ROBOTS["kobuki"]
# Beams to the right, ahead and to the left.
LIDAR = Lidar(beams=3, field_of_view=math.pi, range_max=3.0)
HALL = tables_of(hall())


def scanned(starts, lidar=LIDAR, team=(KOBUKI,), seed=1, step=-1, **options):
    """The world of a hall of 6 m x 4 m, with walls one cell of 25 mm thick, whose robots have sensed."""
    world = KinematicWorld(list(team), lidar, 0.1, 1, **options)
    world.place(0, HALL, np.array(starts, float), HALL.body.solid == 0, seed)
    world.steps[:] = step
    world.move_and_sense(np.zeros((len(team), 2)), moves_bodies=False)
    return world


def test_ranges_end_at_walls_and_where_nothing_is_in_reach_there_is_no_return():
    world = scanned([[1.0, 1.5, 0.0]])
    assert world.ranges[0] == pytest.approx([1.475, math.inf, 2.475], abs=1e-5)
    world = scanned([[5.0, 1.5, 0.0]])
    assert world.ranges[0] == pytest.approx([1.475, 0.975, 2.475], abs=1e-5)
    assert np.array_equal(world.ranges, world.true_ranges)


def test_a_range_ends_in_the_cell_that_the_beam_met():
    many = replace(LIDAR, beams=181, field_of_view=2.0 * math.pi, range_max=8.0)
    world = scanned([[2.2, 1.7, 0.3]], many)
    angles = 0.3 + many.angles
    ends = np.stack([1.7 + world.ranges[0] * np.sin(angles), 2.2 + world.ranges[0] * np.cos(angles)])
    rows, columns = np.floor(ends / 0.025).astype(int)
    assert HALL.laser.solid[rows, columns].mean() > 0.98


def test_other_robots_are_seen_where_they_are_higher_than_the_laser():
    starts = [[2.0, 2.0, 0.0], [3.5, 2.0, 0.0]]
    high, low = replace(KOBUKI, height=LIDAR.height + 0.1), replace(KOBUKI, height=LIDAR.height - 0.1)
    assert scanned(starts, team=(KOBUKI, high)).ranges[0, 1] == pytest.approx(1.5 - KOBUKI.radius, abs=1e-5)
    assert scanned(starts, team=(KOBUKI, low)).ranges[0, 1] == math.inf
    # The nearer robot takes the beam that looks back from the other.
    back = scanned([[2.0, 2.0, 0.0], [3.5, 2.0, math.pi]], team=(high, KOBUKI))
    assert back.ranges[1, 1] == pytest.approx(1.5 - KOBUKI.radius, abs=1e-5)


def noisy(beams=720, **options):
    return Lidar(beams=beams, field_of_view=2.0 * math.pi, range_max=3.0, **options)


def test_noise_is_the_greater_of_a_floor_and_a_share_of_the_range():
    for lidar in (
        noisy(noise_floor=0.02),
        noisy(noise_share=0.02),
        noisy(noise_floor=0.02, noise_share=0.02),
    ):
        residuals = []
        for step in range(40):
            world = scanned([[1.6, 1.5, 0.0]], lidar, step=step)
            true, measured = world.true_ranges[0], world.ranges[0]
            is_met = true < lidar.range_max - 0.2
            deviation = np.maximum(lidar.noise_floor, lidar.noise_share * true[is_met])
            residuals.append((measured[is_met] - true[is_met]) / deviation)
            assert np.array_equal(np.isinf(measured), np.isinf(true))
        drawn = np.concatenate(residuals)
        assert drawn.mean() == pytest.approx(0.0, abs=0.03)
        assert drawn.std() == pytest.approx(1.0, abs=0.03)


def test_measured_ranges_stay_between_the_shortest_and_the_longest():
    lidar = noisy(noise_floor=1.0, range_min=0.5)
    ranges = scanned([[1.0, 1.5, 0.0]], lidar).ranges[0]
    met = ranges[np.isfinite(ranges)]
    assert met.min() == np.float32(0.5)
    assert met.max() == np.float32(3.0 - RANGE_GAP)


def test_noise_depends_on_seed_robot_and_step_alone():
    lidar, starts = noisy(60, noise_floor=0.05), [[1.6, 1.5, 0.0], [4.4, 2.5, math.pi]]
    # The two see the same, each from its end of the hall.
    team = (KOBUKI, KOBUKI)
    first = scanned(starts, lidar, team)
    assert np.array_equal(first.ranges, scanned(starts, lidar, team).ranges)
    assert not np.array_equal(first.ranges, scanned(starts, lidar, team, seed=2).ranges)
    assert not np.array_equal(first.ranges, scanned(starts, lidar, team, step=0).ranges)
    assert first.true_ranges[0] == pytest.approx(first.true_ranges[1], abs=1e-4)
    assert first.ranges[0] != pytest.approx(first.ranges[1], abs=1e-2)


def test_beams_that_a_fault_takes_are_invalid_also_in_ranges_of_other_worlds():
    schedule = (Fault(kind="blind_sector", bearing=math.pi / 2, width=0.2),)
    world = scanned([[1.0, 1.5, 0.0]], step=0, faults=FaultSettings(schedule=schedule))
    assert np.isnan(world.ranges[0]).tolist() == [False, False, True]
    world.true_ranges[0] = 0.5, 0.75, 1.0
    disturb_scan(world._table, 0, 1)
    assert world.ranges[0, :2].tolist() == [0.5, 0.75]
    assert np.isnan(world.ranges[0, 2])


@pytest.mark.parametrize("noise", [0.0, 0.001])
def test_ranges_below_the_least_that_is_measured_are_invalid(noise):
    near = replace(LIDAR, range_min=1.5, noise_floor=noise)
    world = scanned([[1.0, 1.5, 0.0]], near)
    assert math.isnan(world.ranges[0, 0])
    assert world.ranges[0, 1] == math.inf
    assert world.ranges[0, 2] == pytest.approx(2.475, abs=0.01)
