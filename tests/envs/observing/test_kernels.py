"""Kernels write observations as plain formulas say."""

import math

import numpy as np
import pytest
from linked_rooms import TWO_ROOMS

from lidarium.envs.engine.beginnings import make_simulation
from lidarium.envs.observing.kernels import write_parallel, write_serial
from lidarium.envs.observing.spaces import FARTHEST
from lidarium.envs.observing.writer import ObservationWriter
from lidarium.envs.settings.making import make_settings
from lidarium.envs.simulation.kernels.floor_cache import floor_tables
from lidarium.envs.simulation.kernels.scanning import RANGE_GAP

OBSERVE = ("scan", "pose", "velocity", "bumper", "map", "egocentric_map")
OFFSETS = np.array([[0.5, 1.0], [1.0, -2.0]])


class Observed:
    """A team at its start whose arrays a test may change before they are written."""

    def __init__(self, observe=OBSERVE, goals=None):
        self.settings = settings = make_settings(
            robots=2, observe=observe, map_cells=16, egocentric_cells=16, egocentric_scales=(1, 2)
        )
        self.simulation = simulation = make_simulation(settings)
        laser, body = settings.lidar.height, settings.robot.height
        tables = floor_tables(TWO_ROOMS, settings.raster_resolution, laser, body)
        simulation.place(0, tables, TWO_ROOMS.starts, 1)
        simulation.step(np.zeros((2, 2)), moves_bodies=False)
        self.writer = ObservationWriter(simulation, settings, OFFSETS, goals)

    def write(self, active=(True, True), kernel=write_serial):
        arrays = {name: np.full_like(array, 7) for name, array in self.writer.buffers().items()}
        kernel(np.array(active), *self.writer.arguments(arrays))
        return arrays


def test_ranges_end_short_of_the_longest_which_means_no_return_and_zero_that_none_is_valid():
    team = Observed()
    longest = team.settings.lidar.range_max
    team.simulation.ranges[0, :5] = 1.5, longest - 1e-5, longest, math.inf, math.nan
    scan = team.write()["scan"][0, :5]
    just_below = longest - RANGE_GAP
    assert scan == pytest.approx([1.5, just_below, just_below, longest, 0.0], abs=1e-6)
    assert scan[1] < scan[3]


def test_poses_and_goals_are_in_the_map_frame_and_within_bounds():
    team = Observed(goals=np.array([[2.5, 3.0], [math.nan, math.nan]]))
    team.simulation.beliefs.believed[:] = [[1.0, 3.0, 0.5], [2.0 * FARTHEST, 0.0, -3.0]]
    arrays = team.write()
    assert arrays["pose"] == pytest.approx(np.array([[0.5, 2.0, 0.5], [FARTHEST, 2.0, -3.0]]))
    assert arrays["goal"].tolist() == [[2.0, 2.0], [0.0, 0.0]]


def test_velocities_are_clipped_to_what_robots_can_do_and_bumpers_are_as_pressed():
    team = Observed()
    speed, turn_rate = team.settings.speed_limits[0]
    team.simulation.measured[:] = [[0.1, -0.2], [2.0 * speed, -2.0 * turn_rate]]
    team.simulation.bumpers[:] = [[1, 0, 1], [0, 1, 0]]
    arrays = team.write()
    assert arrays["velocity"] == pytest.approx(np.array([[0.1, -0.2], [speed, -turn_rate]]))
    assert arrays["bumper"].tolist() == [[1, 0, 1], [0, 1, 0]]


def levels_of(log_odds):
    return np.where(log_odds > 0, 0, np.where(log_odds < 0, 255, 127))


def test_maps_show_the_levels_around_the_believed_place():
    team = Observed()
    beliefs, resolution = team.simulation.beliefs, team.settings.occupancy.resolution
    for row, believed in enumerate(((0.62, 2.03, 0.0), (3.62, 1.03, 0.0))):
        beliefs.believed[row] = believed
    arrays = team.write()
    for row in range(2):
        column, line = np.floor((beliefs.believed[row, :2] - beliefs.origins[row]) / resolution).astype(int)
        part = beliefs.log_odds[row][line - 8 : line + 8, column - 8 : column + 8]
        assert len(np.unique(levels_of(part))) > 1
        assert np.array_equal(arrays["map"][row, 0], levels_of(part))
        # With its heading along x a turned crop is the map around the nearest corner of cells.
        column, line = np.rint((beliefs.believed[row, :2] - beliefs.origins[row]) / resolution).astype(int)
        part = beliefs.log_odds[row][line - 8 : line + 8, column - 8 : column + 8]
        assert np.array_equal(arrays["egocentric_map"][row, 0], levels_of(part))


def test_what_is_not_active_or_not_observed_is_not_written():
    for kernel in (write_serial, write_parallel):
        team = Observed(observe=("pose", "bumper"))
        arrays = team.write((False, True), kernel)
        assert set(arrays) == {"pose", "bumper"}
        assert (arrays["pose"][0] == 7).all()
        assert arrays["pose"][1] == pytest.approx(TWO_ROOMS.starts[1] - [*OFFSETS[1], 0.0])


def test_threads_write_the_same():
    serial, parallel = (Observed().write(kernel=kernel) for kernel in (write_serial, write_parallel))
    for name, array in serial.items():
        assert np.array_equal(array, parallel[name]), name
