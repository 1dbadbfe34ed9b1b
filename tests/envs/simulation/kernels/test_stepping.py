"""The kernels of a step: what drives, wheels, localizers and threads make of commands."""

import math

import numpy as np
import pytest
from scored_halls import hall, tables_of

from lidarium.envs.settings.faults import Fault, FaultSettings
from lidarium.envs.settings.lidar import Lidar
from lidarium.envs.settings.odometry import ODOMETRY, OdometrySettings
from lidarium.envs.settings.robots import ROBOTS
from lidarium.envs.simulation.kernels.arrays import ENDED
from lidarium.envs.simulation.kernels.stepping import (
    drive,
    encode,
    perceive_parallel,
    perceive_serial,
    ranges_without_teammates,
    render_row,
    score_and_localize,
    sense,
    step_rows,
    step_serial,
)
from lidarium.envs.simulation.kinematic_simulation import KinematicSimulation
from lidarium.envs.simulation.rewards import TERMS
from lidarium.mapping.grids.occupancy import OccupancySettings

KOBUKI, HALL = ROBOTS["kobuki"], tables_of(hall())
STARTS = np.array([[1.0, 2.0, 0.5], [3.5, 2.4, math.pi / 2]])
LIDAR = Lidar(beams=181)
BOTH, FIRST = np.ones(2, np.bool_), np.array([True, False])
AHEAD = np.tile([0.2, 0.0], (4, 1))


def team(known_starts=True, **options):
    """Two episodes of two robots each, before the scan at their starts."""
    options = {"lidar": LIDAR, "occupancy": OccupancySettings(resolution=0.05), "episodes": 2, **options}
    made = KinematicSimulation.of_team([KOBUKI] * 2, **options)
    for episode in range(2):
        made.place(episode, HALL, STARTS, 11 + episode, known_starts)
    return made


def state(simulation):
    world, score = simulation.world, simulation.score
    arrays = {name: getattr(world, name) for name in ("poses", "velocities", "ranges", "steps", "contacts")}
    arrays |= {name: getattr(score, name) for name in ("seen", "gains", "team_seen", "rewards")}
    arrays |= {f"map {row}": log_odds for row, log_odds in enumerate(simulation.beliefs.log_odds)}
    return {**arrays, "believed": simulation.beliefs.believed}


def run(simulation, step, steps=15):
    step(simulation.table, 2, np.zeros((4, 2)), BOTH, False, True)
    for _ in range(steps):
        step(simulation.table, 2, np.tile([[0.3, 0.4], [0.2, -0.3]], (2, 1)), BOTH, True, True)
    return state(simulation)


def test_threads_over_robots_come_to_the_same_as_one_after_the_other():
    options = {"odometry": ODOMETRY["typical"], "localization": "odometry"}
    serial, parallel = run(team(**options), step_serial), run(team(**options), step_rows)
    for name, array in serial.items():
        assert np.array_equal(array, parallel[name]), name
    perceived = [team(), team()]
    for simulation, perceive in zip(perceived, (perceive_serial, perceive_parallel), strict=True):
        step_serial(simulation.table, 2, AHEAD, BOTH, False, False)
        assert not any(log_odds.any() for log_odds in simulation.beliefs.log_odds)
        perceive(simulation.table, 2, FIRST)
    for row in range(4):
        maps = [simulation.beliefs.log_odds[row] for simulation in perceived]
        assert np.array_equal(*maps)
        assert maps[0].any() == (row < 2)


def test_only_chosen_episodes_run_and_who_has_ended_senses_nothing():
    simulation = team()
    simulation.world.flags[1] |= ENDED
    step_serial(simulation.table, 2, AHEAD, FIRST, True, True)
    assert simulation.world.steps.tolist() == [0, -1]
    assert np.isfinite(simulation.ranges).any(axis=1).tolist() == [True, False, False, False]
    assert (simulation.score.seen > 0).tolist() == [True, False, False, False]
    sense(simulation.table, 2, ~FIRST)
    assert np.isfinite(simulation.ranges).any(axis=1).tolist() == [True, False, True, True]


def test_cells_are_credited_and_paid_for_once():
    weights = np.zeros(len(TERMS))
    weights[0] = 0.01
    simulation = team(reward_weights=weights)
    sense(simulation.table, 2, BOTH)
    score_and_localize(simulation.table, 2, BOTH)
    score = simulation.score
    assert (score.gains > 0.0).all()
    assert score.gains.reshape(2, 2).sum(axis=1) == pytest.approx(score.team_seen)
    assert score.rewards == pytest.approx(0.01 * score.gains)
    score_and_localize(simulation.table, 2, BOTH)
    assert not score.gains.any()
    assert simulation.world.steps.tolist() == [1, 1]


@pytest.mark.parametrize("known_starts", [True, False])
@pytest.mark.parametrize("localization", ["truth", "odometry"])
def test_robots_believe_the_truth_or_their_wheels_in_the_frame_that_they_know(known_starts, localization):
    simulation = team(known_starts, localization=localization)
    run(simulation, step_serial)
    believed, poses = simulation.beliefs.believed, simulation.world.poses
    for row, start in enumerate(np.tile(STARTS, (2, 1))):
        x, y, theta = poses[row]
        if not known_starts:
            cosine, sine = math.cos(start[2]), math.sin(start[2])
            x, y = x - start[0], y - start[1]
            x, y, theta = cosine * x + sine * y, cosine * y - sine * x, theta - start[2]
        # Ideal wheels reckon what the robot drove, to within rounding.
        assert believed[row, :2] == pytest.approx([x, y], abs=1e-6)
        assert math.remainder(believed[row, 2] - theta, math.tau) == pytest.approx(0.0, abs=1e-6)


def test_drives_are_disturbed_stuck_dead_or_put_elsewhere():
    schedule = (
        Fault(kind="stuck_wheel", robot=0, at_s=0.0, wheel="left"),
        Fault(kind="dead_robot", robot=1, at_s=0.5),
        Fault(kind="kidnapping", robot=0, at_s=0.5, lasts_s=0.1, place=(5.0, 1.0, 0.25)),
    )
    simulation = team(faults=FaultSettings(schedule=schedule))
    world = simulation.world
    world.steps[:] = 0
    world.velocities[0] = 0.2, 0.0
    drive(simulation.table, 2, AHEAD, FIRST)
    # The right wheel alone: half the speed, turning to the left about the left wheel.
    assert world.driven[0] == pytest.approx([0.1, 0.2 / KOBUKI.wheel_base])
    assert world.driven[1].tolist() == [0.2, 0.0]
    assert not world.driven[2:].any()
    assert world.failed.tolist() == [0, 0, 0, 0]
    world.steps[:] = 5
    drive(simulation.table, 2, AHEAD, FIRST)
    assert world.poses[0].tolist() == [5.0, 1.0, 0.25]
    assert world.failed.tolist() == [0, 1, 0, 0]
    assert world.moves.tolist() == [1, 0, 1, 1]


def test_encoders_read_what_the_wheels_drove():
    simulation = team(odometry=OdometrySettings(distance_bias=0.1), localization="odometry")
    encode(simulation.table, 2, AHEAD, FIRST)
    measured = simulation.world.measured
    assert np.abs(measured[:2, 0] - 0.2) == pytest.approx(0.02)
    assert simulation.odometry[:2, 0] == pytest.approx(0.1 * measured[:2, 0])
    assert not measured[2:].any()


def test_a_map_is_rendered_of_scans_without_a_trace_in_the_robot():
    simulation = team()
    step_serial(simulation.table, 2, AHEAD, BOTH, False, True)
    beliefs = simulation.beliefs
    wanted, believed = beliefs.log_odds[2].copy(), beliefs.believed.copy()
    # The teammate is drawn as it was seen; elsewhere the map is the same.
    poses, ranges = believed[2:3].copy(), simulation.ranges[2:3].copy()
    beliefs.wipe(2)
    render_row(simulation.table, 2, 2, poses, ranges)
    rendered = beliefs.log_odds[2].copy()
    assert (rendered != wanted).sum() < 0.02 * (wanted != 0).sum()
    beliefs.wipe(2)
    poses[0, 0] += 1.0
    render_row(simulation.table, 2, 2, poses, ranges)
    assert np.array_equal(beliefs.log_odds[2][:, 20:], rendered[:, :-20])
    assert np.array_equal(beliefs.believed, believed)
    assert np.array_equal(simulation.ranges[2:3], ranges)


def test_beams_that_met_known_teammates_are_invalid():
    starts = np.array([[1.0, 2.0, 0.0], [2.5, 2.0, 0.0]])
    for known_starts in (True, False):
        simulation = team()
        simulation.place(0, HALL, starts, 1, known_starts)
        step_serial(simulation.table, 2, AHEAD, FIRST, False, False)
        ranges = np.empty(LIDAR.beams, np.float32)
        ranges_without_teammates(simulation.table, 0, 2, ranges)
        middle = LIDAR.beams // 2
        assert simulation.ranges[0, middle] == pytest.approx(1.5 - KOBUKI.radius, abs=1e-4)
        assert np.isnan(ranges[middle]) == known_starts
        assert ranges[0] == simulation.ranges[0, 0]
