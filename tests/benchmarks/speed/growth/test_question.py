import numpy as np
import pytest

from lidarium.benchmarks.results_page import about
from lidarium.benchmarks.speed.cases.histories import Histories, drawn_drives
from lidarium.benchmarks.speed.growth.idle_memory import IdleMemory, array_bytes, measure, own_bytes
from lidarium.benchmarks.speed.growth.question import (
    Growth,
    growth_page,
    growth_result,
    growth_table,
    growth_with_floors,
    growth_with_robots,
    memory_table,
)
from lidarium.benchmarks.speed.scenes.floors import straight_floor, team_poses
from lidarium.envs.settings.lidar import Lidar
from lidarium.envs.settings.robots import ROBOTS
from lidarium.envs.simulation.kinematic_simulation import KinematicSimulation
from lidarium.mapping.grids.occupancy import OccupancySettings


@pytest.fixture(scope="module")
def drives():
    return drawn_drives(straight_floor(256, 256), 8, 2, 2)


def test_ratios_are_taken_repeat_by_repeat_and_held_against_what_is_allowed():
    growth = Growth("robots", "8", 1, [2.0, 4.0, 9.0], [1.0, 2.0, 3.0], 2.0)
    assert growth.ratio.median == 2.0
    assert growth.time.median == 4.0
    assert growth.is_kept
    assert not Growth("robots", "8", 1, [2.0], [1.0], 1.9).is_kept
    assert Growth("robots", "8", 1, [2.0], [1.0]).is_kept is None


def test_a_drive_ends_in_the_same_place_in_a_batch_of_any_size(drives):
    small, large = Histories(drives, 2, 0.025), Histories(drives, 8, 0.025)
    small.run()
    large.run()
    assert np.array_equal(small.simulation.world.poses, large.simulation.world.poses[-2:])
    assert not np.array_equal(large.simulation.world.poses, drives.starts)


def test_robots_on_the_maps_of_others_drive_alike_in_less_memory(drives):
    own, shared = Histories(drives, 8, 0.025), Histories(drives, 8, 0.025, maps=2)
    own.run()
    shared.run()
    assert np.array_equal(own.simulation.ranges, shared.simulation.ranges)
    assert own.working_set == 4 * shared.working_set
    assert not shared.simulation.beliefs.log_odds[2].any()
    assert own.simulation.beliefs.log_odds[2].any()


def test_teams_start_apart_and_clear_of_walls():
    floor = straight_floor(256, 256)
    places = team_poses(floor, 20, 2)[:, :2].reshape(20, 2, 2)
    assert (np.hypot(*(places[:, 0] - places[:, 1]).T) > 0.6).all()
    rows, columns = (places.reshape(-1, 2)[:, ::-1] / floor.resolution).astype(int).T
    assert not floor.solid[rows, columns].any()


def test_growth_is_told_for_every_size_and_for_shared_maps(drives):
    growths = growth_with_robots(drives, 0.05, (2, 8), repeats=2, allowed={8: 1.8})
    assert [growth.name for growth in growths] == ["2 robots", "8 robots", "8 robots on the maps of 2"]
    assert [growth.allowed for growth in growths] == [None, 1.8, None]
    assert growths[0].ratio.median == 1.0
    floors = growth_with_floors((256, 300), drives=4, repeats=1)
    assert [growth.name for growth in floors] == ["6 m", "8 m"]


def test_the_page_of_growth_has_both_tables(tmp_path):
    growths = [Growth("robots", "8", 2**20, [2e-5], [1e-5], 1.8)]
    memory = IdleMemory(1024, 1000, 1100.0, 1300.0, None)
    result = growth_result(growths, memory, 15, about("python growth.py"))
    page = growth_page(result, growths, memory)
    assert "| robots | 8 | 1.0 MiB | 20.0 us (20.0 to 20.0) | 2.00 (2.00 to 2.00) | <= 1.8 | no |" in growth_table(
        growths
    )
    assert "| arrays that belong to the robot | 1.10 | <= 1.2 | yes |" in memory_table(memory)
    assert "resident" not in memory_table(memory)
    assert growth_table(growths) in page
    assert memory_table(memory) in page
    assert result["growth"][0]["ratio"]["median"] == 2.0


def test_arrays_are_counted_once_and_by_their_whole():
    numbers = np.zeros(100)
    assert array_bytes({"a": numbers, "b": [numbers[:10], (numbers[5:],)]}) == 800


def test_what_belongs_to_a_robot_is_its_map_mask_and_rows():
    floor = straight_floor(256, 256)
    simulation = KinematicSimulation.of_team(
        [ROBOTS["kobuki"]], Lidar(beams=90), OccupancySettings(resolution=0.025), episodes=3
    )
    for episode in range(3):
        simulation.place(episode, floor.tables(), team_poses(floor, 1, 1), seed=0)
    own = own_bytes(simulation)
    grids = simulation.beliefs.log_odds[0].nbytes + simulation.score.masks[0].nbytes
    assert grids + 4 * 90 < own < grids + 4 * 90 + 1100  # rows of poses, speeds, scores


def test_idle_robots_are_measured_beside_their_map():
    memory = measure(2, 6)
    assert 1.0 < memory.own_bytes / memory.map_bytes < memory.all_bytes / memory.map_bytes < 2.0
