"""A kinematic world with maps and score, stepped in one kernel call."""

import numpy as np
import pytest
from linked_rooms import TWO_ROOMS
from scored_halls import hall, tables_of

from lidarium.envs.settings.cameras import DepthCamera
from lidarium.envs.settings.faults import Fault, FaultSettings
from lidarium.envs.settings.lidar import Lidar
from lidarium.envs.settings.odometry import ODOMETRY
from lidarium.envs.settings.robots import ROBOTS
from lidarium.envs.simulation.kernels.arrays import DEAD_RECKONING, KNOWN_TEAMMATES, SOME_TEAMMATES, TRUE_POSE
from lidarium.envs.simulation.kernels.floor_cache import FloorTables
from lidarium.envs.simulation.kinematic_simulation import KinematicSimulation
from lidarium.envs.simulation.rewards import TERMS
from lidarium.envs.simulation.simulation import Simulation
from lidarium.mapping.grids.occupancy import OccupancySettings

LIDAR, OCCUPANCY = Lidar(beams=61), OccupancySettings(resolution=0.05)
HALL, STARTS = tables_of(hall()), np.array([[1.0, 2.0, 0.0], [4.0, 2.0, 3.0]])
TEAM = [ROBOTS["kobuki"], ROBOTS["pioneer"]]


def made(episodes=2, **options):
    simulation = KinematicSimulation.of_team(TEAM, LIDAR, OCCUPANCY, episodes=episodes, **options)
    for episode in range(episodes):
        simulation.place(episode, HALL, STARTS, episode)
    return simulation


def test_options_reach_the_world_the_poses_and_the_simulation():
    faults = FaultSettings(schedule=(Fault(kind="dead_robot", robot=1, at_s=0.0),))
    weights = np.arange(float(len(TERMS)))
    simulation = made(
        odometry=ODOMETRY["good"],
        faults=faults,
        horizon_s=5.0,
        localization="odometry",
        knows_teammates=False,
        reward_weights=weights,
        scales=(1, 2),
    )
    assert simulation.is_fused
    assert np.array_equal(simulation.world.bodies, [robot.numbers for robot in TEAM])
    assert np.array_equal(simulation.world.odometry_model, ODOMETRY["good"].numbers)
    assert simulation.world.faults.any(axis=1).tolist() == [False, True, False, True]
    assert np.array_equal(simulation.score.reward_weights, weights)
    assert simulation.beliefs.scales == (1, 2)
    assert (simulation.world.flags == DEAD_RECKONING | SOME_TEAMMATES).all()
    assert (made().world.flags == TRUE_POSE | KNOWN_TEAMMATES).all()


def test_unknown_options_are_refused():
    with pytest.raises(TypeError, match="colour"):
        made(colour="red")


@pytest.mark.parametrize("threads", [1, 2])
def test_a_step_is_that_of_the_parts_one_after_the_other(threads):
    fused = made(4, threads=threads)
    staged = Simulation(made(4).world, LIDAR, OCCUPANCY)
    for episode in range(4):
        staged.place(episode, HALL, STARTS, episode)
    runs = np.array([True, True, False, True])
    for simulation in (fused, staged):
        simulation.step(np.zeros((8, 2)), moves_bodies=False)
        for step in range(12):
            simulation.step(np.tile([[0.3, 0.2], [0.1, -0.4]], (4, 1)), runs=runs if step % 3 else None)
    assert fused.world.steps.tolist() == staged.world.steps.tolist() == [12, 12, 4, 12]
    for name in ("poses", "velocities", "ranges", "travelled"):
        assert np.array_equal(getattr(fused.world, name), getattr(staged.world, name)), name
    for name in ("seen", "team_seen", "gains"):
        assert np.array_equal(getattr(fused.score, name), getattr(staged.score, name)), name
    for one, other in zip(fused.beliefs.log_odds, staged.beliefs.log_odds, strict=True):
        assert np.array_equal(one, other)


def test_maps_can_be_left_as_they_are():
    simulation = made()
    simulation.step(np.zeros((4, 2)), moves_bodies=False, perceives=False)
    assert not any(log_odds.any() for log_odds in simulation.beliefs.log_odds)
    assert (simulation.score.seen > 0).all()
    simulation.perceive()
    assert all(log_odds.any() for log_odds in simulation.beliefs.log_odds)


def test_cameras_take_their_images_at_the_step_that_the_kernel_has_counted():
    simulation = made()
    simulation.mount(DepthCamera(columns=8, rows=6, rate_hz=5.0))
    tables = FloorTables.of_floor(TWO_ROOMS, 0.025, LIDAR.height, TEAM[0].height)
    for episode in range(2):
        simulation.place(episode, tables, TWO_ROOMS.starts, episode)
    taken = []
    for step in range(4):
        simulation.step(np.zeros((4, 2)), moves_bodies=step > 0)
        taken.append(simulation.camera.taken_at.tolist())
    assert taken == [[0] * 4, [0] * 4, [2] * 4, [2] * 4]
