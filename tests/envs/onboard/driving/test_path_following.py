"""Path following and the safety stop, on hand-made paths in the simulation itself."""

import itertools
import math

import numpy as np
import pytest

import lidarium
from lidarium.envs.floors.floor import Floor, Raster, Solid
from lidarium.envs.onboard.driving.path_following import (
    ARRIVED,
    BLOCKED,
    DRIVING,
    IDLE,
    MAX_POINTS,
    Courses,
    follow_paths,
)
from lidarium.envs.onboard.driving.safety_stop import FORESIGHT_TIMES, Bodies, Sensed
from lidarium.envs.onboard.radio.messages import DriveState, Target
from lidarium.envs.settings.lidar import Lidar
from lidarium.envs.settings.robots import ROBOTS
from lidarium.envs.simulation.kernels.contact import distance_bound
from lidarium.envs.simulation.kernels.floor_cache import FloorTables
from lidarium.envs.simulation.kernels.ray_tables import RayTables
from lidarium.envs.simulation.kinematic_simulation import KinematicSimulation
from lidarium.mapping.grids.occupancy import OccupancySettings


def hall(rows=200, columns=280, boxes=()):
    solid = np.zeros((rows, columns), np.uint8)
    solid[0], solid[-1], solid[:, 0], solid[:, -1] = 1, 1, 1, 1
    for row, column, height, width in boxes:
        solid[row : row + height, column : column + width] = 1
    raster = Raster(solid, (0.0, 0.0), 0.025)
    return FloorTables(raster, raster, RayTables(solid), distance_bound(solid))


class Drive:
    """Robots that follow hand-made paths."""

    def __init__(self, tables, starts, paths, heading=math.nan, knows_teammates=True, margin=0.3):
        count = len(starts)
        self.simulation = KinematicSimulation.of_team([ROBOTS["kobuki"]] * count, Lidar(), OccupancySettings())
        self.simulation.place(0, tables, np.array(starts, np.float64), 1)
        self.simulation.step(np.zeros((count, 2)), moves_bodies=False)
        robot = ROBOTS["kobuki"]
        self.limits = np.array([robot.cruise_speed, 2.0, 0.8 * robot.max_acceleration, 0.1])
        self.paths, self.margins = np.zeros((count, MAX_POINTS, 2)), np.full((count, MAX_POINTS), margin)
        self.counts = np.array([len(path) for path in paths])
        for k, path in enumerate(paths):
            self.paths[k, : len(path)] = np.reshape(path, (-1, 2))
        self.places, self.headings = np.minimum(1, self.counts - 1), np.full(count, heading)
        self.states = np.where(self.counts > 0, DRIVING, IDLE)
        self.stood, self.backing = np.zeros(count, np.int64), np.zeros(count, np.int64)
        self.knows_teammates, self.present = knows_teammates, np.ones(count, np.uint8)
        self.commands, self.track, self.speeds = np.zeros((count, 2)), [], []

    def step(self, steps=1):
        simulation = self.simulation
        for _ in range(steps):
            follow_paths(
                Sensed(
                    simulation.beliefs.believed,
                    simulation.world.velocities,
                    simulation.ranges,
                    simulation.beliefs.scanned,
                    simulation.beliefs.contact,
                    simulation.beliefs.heard,
                    simulation.safety,
                ),
                Courses(
                    self.paths,
                    self.margins,
                    self.counts,
                    self.places,
                    self.headings,
                    self.states,
                    self.stood,
                    self.backing,
                ),
                Bodies(
                    np.stack([lidar.unit_vectors for lidar in simulation.lidars]),
                    simulation.world.bodies[:, 0].copy(),
                    self.limits,
                    self.knows_teammates,
                    self.present,
                    FORESIGHT_TIMES,
                ),
                self.commands,
            )
            simulation.step(self.commands)
            self.track.append(simulation.world.poses.copy())
            self.speeds.append(simulation.world.velocities.copy())
        return self

    def until_done(self, limit=600):
        for _ in range(limit):
            self.step()
            if not (self.states == DRIVING).any():
                return self
        raise AssertionError("the drive did not end")


def distance_to_path(points, path):
    path = np.asarray(path, np.float64)
    nearest = np.full(len(points), math.inf)
    for a, b in itertools.pairwise(path):
        share = np.clip(((points - a) @ (b - a)) / ((b - a) @ (b - a)), 0.0, 1.0)
        nearest = np.minimum(nearest, np.hypot(*(points - a - share[:, None] * (b - a)).T))
    return nearest


PATHS = {
    "straight": [(1.0, 1.0), (5.0, 1.0)],
    "back": [(1.0, 1.0), (0.6, 1.0)],
    "corner": [(1.0, 1.0), (4.0, 1.0), (4.0, 4.0)],
    "zigzag": [(1.0, 1.0), (2.0, 2.0), (3.0, 1.0), (4.0, 2.0), (5.0, 1.0)],
    "hairpin": [(1.0, 1.0), (4.0, 1.0), (4.0, 1.3), (1.0, 1.3)],
}


@pytest.mark.parametrize("heading", [0.0, 2.5, -1.5])
@pytest.mark.parametrize("name", PATHS)
def test_a_path_is_followed_to_its_end_without_leaving_it(name, heading):
    path = PATHS[name]
    drive = Drive(hall(), [(*path[0], heading)], [path]).until_done()
    assert drive.states[0] == ARRIVED
    assert math.dist(drive.simulation.world.poses[0, :2], path[-1]) <= 0.05
    track = np.array(drive.track)[:, 0, :2]
    assert distance_to_path(track, path).max() < 0.13
    assert drive.simulation.world.collisions[0] == 0
    assert np.array(drive.speeds)[:, 0, 0].max() <= 0.33 + 1e-9
    length = np.hypot(*np.diff(np.array(path), axis=0).T).sum()
    assert drive.simulation.world.travelled[0] < 1.1 * length + 0.1


@pytest.mark.parametrize("margin", [0.0, 0.02])
def test_where_it_is_tight_the_path_is_kept_to_within_millimetres(margin):
    path = PATHS["corner"]
    drive = Drive(hall(), [(*path[0], 0.0)], [path], margin=margin).until_done(1500)
    assert drive.states[0] == ARRIVED
    assert distance_to_path(np.array(drive.track)[:, 0, :2], path).max() < 0.02 + 0.5 * margin


@pytest.mark.parametrize("heading", [0.0, 1.57, -3.0, 3.1])
def test_at_the_end_the_robot_turns_to_the_wanted_heading(heading):
    drive = Drive(hall(), [(1.0, 1.0, 0.0)], [PATHS["straight"]], heading).until_done()
    assert abs(math.remainder(drive.simulation.world.poses[0, 2] - heading, 2.0 * math.pi)) <= 0.15


def test_the_robot_stops_before_a_wall_that_its_path_crosses():
    drive = Drive(hall(boxes=[(0, 120, 200, 4)]), [(1.0, 1.0, 0.0)], [[(1.0, 1.0), (5.0, 1.0)]]).until_done()
    assert drive.states[0] == BLOCKED
    assert drive.simulation.world.collisions[0] == 0
    gap = 120 * 0.025 - 0.18 - drive.simulation.world.poses[0, 0]
    assert 0.0 < gap < 0.05


@pytest.mark.parametrize("offset", [-0.17, -0.1, 0.0, 0.1, 0.17])
def test_the_robot_stops_before_a_post_in_any_part_of_its_swath(offset):
    row = round((2.0 + offset) / 0.025)
    drive = Drive(hall(boxes=[(row, 120, 1, 1)]), [(1.0, 2.0, 0.0)], [[(1.0, 2.0), (5.0, 2.0)]]).until_done()
    assert drive.states[0] == BLOCKED
    assert drive.simulation.world.collisions[0] == 0


def test_the_robot_passes_a_post_just_beside_its_swath():
    drive = Drive(
        hall(boxes=[(round(2.2 / 0.025), 120, 1, 1)]), [(1.0, 2.0, 0.0)], [[(1.0, 2.0), (5.0, 2.0)]]
    ).until_done()
    assert drive.states[0] == ARRIVED
    assert drive.simulation.world.collisions[0] == 0


@pytest.mark.parametrize("knows_teammates", [True, False])
def test_the_robot_stops_before_a_body_that_appears_on_its_way_and_goes_on_when_it_is_gone(knows_teammates):
    drive = Drive(
        hall(),
        [(1.0, 2.0, 0.0), (4.0, 4.0, 0.0)],
        [[(1.0, 2.0), (5.0, 2.0)], []],
        knows_teammates=knows_teammates,
    ).step(25)
    speed = float(drive.simulation.world.velocities[0, 0])
    assert speed == pytest.approx(0.33, abs=0.01)
    # As near as it can still stop: its braking way, a step, and the gap.
    drive.simulation.world.poses[1, :2] = drive.simulation.world.poses[0, :2] + [0.36 + 0.2, 0.0]
    drive.step(60)
    assert drive.simulation.world.collisions.tolist() == [0, 0]
    assert drive.states[0] == BLOCKED
    assert drive.simulation.world.poses[1, 0] - drive.simulation.world.poses[0, 0] > 0.36
    drive.simulation.world.poses[1, :2] = [4.0, 4.0]
    drive.step(250)
    assert drive.states[0] == ARRIVED


def test_two_whose_ways_cross_never_touch():
    for late in (0.0, 0.3, 0.6):
        paths = [[(1.0, 2.5), (5.0, 2.5)], [(3.0, 0.5 - late / 2), (3.0, 4.5)]]
        drive = Drive(hall(), [(1.0 + late / 2, 2.5, 0.0), (*paths[1][0], math.pi / 2)], paths).until_done(1000)
        assert drive.simulation.world.collisions.sum() == 0
        track = np.array(drive.track)
        assert np.hypot(*(track[:, 0, :2] - track[:, 1, :2]).T).min() > 0.36


def test_robots_without_a_path_stand():
    drive = Drive(hall(), [(1.0, 2.0, 0.0)], [[]]).step(10)
    assert np.array_equal(drive.simulation.world.poses[0], [1.0, 2.0, 0.0])
    assert drive.states[0] == IDLE


# ---- the whole driving, with planning


def wall(x, y, width, height):
    return Solid(np.array([[x, y], [x + width, y], [x + width, y + height], [x, y + height]]))


def driven(floor, targets, decisions=60, robots=2, **options):
    """Send robots to targets in the floor's frame until all have arrived; None stays."""
    env = lidarium.parallel_env(
        floor,
        level="waypoint",
        robots=robots,
        stop_coverage=None,
        horizon_s=None,
        map_cells=32,
        lidar="lidar_360_6m",
        **{"starts": "fixed", **options},
    )
    env.reset(seed=0)
    base = env.unwrapped
    orders = {
        agent: None if target is None else Target(*(np.asarray(target) - base.perception.poses.offset(row)))
        for row, (agent, target) in enumerate(zip(env.agents, targets, strict=True))
    }
    states, tracks = [], []
    for _ in range(decisions):
        infos = env.step(orders)[4]
        states.append([infos[agent]["drive"] for agent in orders])
        tracks.append(base.world.poses[:, :2].copy())
        if all(
            state is DriveState.ARRIVED for state, target in zip(states[-1], targets, strict=True) if target is not None
        ):
            break
    return base, states, np.array(tracks)


def corridor(width=0.6, niche=True):
    """A corridor between two rooms, too narrow for two; a niche in its middle."""
    y = 1.5
    below = (wall(1.6, 0.0, 4.8, y - width / 2),)
    above = (
        (wall(1.6, y + width / 2, 2.0, 2.0), wall(4.2, y + width / 2, 2.2, 2.0))
        if niche
        else (wall(1.6, y + width / 2, 4.8, 2.0),)
    )
    lid = (wall(3.4, y + width / 2 + 0.6, 1.0, 1.0),) if niche else ()
    return Floor(
        "corridor",
        (0.0, 0.0, 8.0, 3.0),
        (*below, *above, *lid),
        starts=np.array([[0.9, 1.5, 0.0], [7.1, 1.5, math.pi]]),
    )


@pytest.mark.parametrize("niche", [True, False])
def test_two_robots_head_on_in_a_corridor_pass_each_other_because_one_gives_way(niche):
    base, states, _ = driven(corridor(niche=niche), [(7.1, 1.5), (0.9, 1.5)], decisions=120)
    assert [state is DriveState.ARRIVED for state in states[-1]] == [True, True]
    assert any(DriveState.GIVING_WAY in pair for pair in states)
    assert base.world.collisions.sum() == 0
    assert base.world.poses[0, 0] > 6.9
    assert base.world.poses[1, 0] < 1.1


def test_an_idle_robot_in_the_way_moves_aside():
    floor = corridor()
    starts = np.array([[0.9, 1.5, 0.0], [3.0, 1.5, math.pi]])
    base, states, tracks = driven(
        Floor("corridor", floor.bounds, floor.solids, starts=starts), [(7.1, 1.5), None], decisions=120
    )
    assert states[-1][0] is DriveState.ARRIVED
    assert any(pair[1] is DriveState.GIVING_WAY for pair in states)
    assert np.hypot(*(tracks[:, 1] - [3.0, 1.5]).T).max() > 0.4
    assert base.world.collisions.sum() == 0


def test_two_whose_ways_cross_both_arrive():
    floor = Floor("hall", (0.0, 0.0, 6.0, 5.0), starts=np.array([[1.0, 2.5, 0.0], [3.0, 0.5, math.pi / 2]]))
    base, states, _ = driven(floor, [(5.0, 2.5), (3.0, 4.5)])
    assert [state is DriveState.ARRIVED for state in states[-1]] == [True, True]
    assert base.world.collisions.sum() == 0


def test_three_robots_through_one_door_all_arrive():
    floor = Floor(
        "door",
        (0.0, 0.0, 6.0, 4.0),
        (wall(3.0, 0.0, 0.2, 1.7), wall(3.0, 2.3, 0.2, 1.7)),
        starts=np.array([[1.0, 1.0, 0.0], [5.0, 2.0, 3.0], [1.0, 3.0, 0.0]]),
    )
    base, states, _ = driven(floor, [(5.0, 1.0), (1.0, 2.0), (5.0, 3.0)], decisions=120, robots=3)
    assert all(state is DriveState.ARRIVED for state in states[-1])
    assert base.world.collisions.sum() == 0


def test_a_robot_that_has_ended_is_driven_round():
    floor = Floor("hall", (0.0, 0.0, 6.0, 3.0), starts=np.array([[1.0, 1.5, 0.0], [3.0, 1.5, 0.0]]))
    env = lidarium.parallel_env(
        floor, level="waypoint", robots=2, stop_coverage=None, map_cells=32, lidar="lidar_360_6m", starts="fixed"
    )
    env.reset(seed=0)
    env.stop("robot_1", "stopped")
    env.step({"robot_0": None})
    for _ in range(30):
        info = env.step({"robot_0": Target(4.0, 0.0)})[4]["robot_0"]
        if info["drive"] is DriveState.ARRIVED:
            break
    assert info["drive"] is DriveState.ARRIVED
    assert env.unwrapped.world.collisions.sum() == 0
