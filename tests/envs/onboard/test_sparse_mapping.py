"""The sparse maps that robots make on board: what they hold, and how they follow corrected poses."""

import math

import numpy as np
import pytest

import lidarium
from lidarium.envs.floors.floor import Floor, Solid
from lidarium.envs.onboard.sparse_maps import SparseMapper
from lidarium.envs.settings.cameras import CAMERAS
from lidarium.envs.settings.making import make_settings
from lidarium.mapping.geometry.rigid import Transform, composed, relative
from lidarium.mapping.localization.localizer import KeyScans
from lidarium.mapping.sparse.exploring.ground import BLOCKED, SEEN, UNKNOWN
from lidarium.mapping.sparse.exploring.views import Sight
from tests.ground_views import depth_image

NOBODY = np.empty((0, 3))


def block(x, y, width, depth, low=0.0, high=2.0):
    outline = np.array([[x, y], [x + width, y], [x + width, y + depth], [x, y + depth]])
    return Solid(outline, low, high)


TABLE = block(3.0, 1.5, 1.0, 1.0, 0.38, 0.42)
HALL = Floor(
    "hall",
    (0.0, 0.0, 7.0, 4.0),
    (TABLE, block(5.2, 3.0, 0.4, 1.0)),
    starts=np.array([[1.0, 2.0, 0.0], [1.0, 0.8, 0.4]]),
)


def made(floor=HALL, **options):
    env = lidarium.parallel_env(
        floor,
        **{"starts": "fixed", "robots": 1, "camera": "xtion_tilted", "stop_coverage": None, "map_cells": 32, **options},
    )
    env.reset(seed=0)
    return env


def turned_round(env, steps=60):
    for _ in range(steps):
        env.step({agent: np.array([0.0, 0.5], np.float32) for agent in env.agents})
    return env


def in_frame(env, x, y, row=0):
    return np.array([x, y]) - env.perception.poses.offset(row)


def test_a_robot_maps_what_its_camera_sees_from_when_it_is_asked():
    env = made()
    assert not env.perception.sparse_maps.made
    first = env.belief("robot_0").sparse_map
    assert list(env.perception.sparse_maps.made) == [0]
    turned_round(env)
    known = env.belief("robot_0").sparse_map
    assert known.seen_m2 > 2.0 * first.seen_m2
    boxes = known.navigation.index.boxes
    # Walls run along the axes of the floor, so the map has its axes.
    on_table = np.array([3.0 - 0.02, 1.5 - 0.02, 4.0 + 0.02, 2.5 + 0.02])
    is_table = (boxes[:, :2] >= on_table[:2]).all(axis=1) & (boxes[:, 3:5] <= on_table[2:]).all(axis=1)
    assert is_table.any(), "the laser's plane is below the table"
    assert boxes[is_table, 5] == pytest.approx(0.42, abs=0.05)
    ground = known.navigation.ground
    rows, columns = ground.cells_of(np.array([[3.1, 2.0]])).T
    assert ground.levels[rows, columns] == BLOCKED
    assert not known.are_unknown(in_frame(env, 3.1, 2.0)[None]).any()
    assert known.are_unknown(in_frame(env, 5.4, 3.8)[None]).all()
    env.reset(seed=0)
    assert not env.perception.sparse_maps.made


def test_a_path_on_the_map_leads_round_what_the_laser_does_not_see():
    env = turned_round(made())
    belief = env.belief("robot_0")
    route = belief.sparse_map.route(belief.pose[:2], in_frame(env, 4.6, 1.0))
    assert not route.reason
    for x, y in route.points + env.perception.poses.offset(0):
        gap = math.hypot(max(3.0 - x, 0, x - 4.0), max(1.5 - y, 0, y - 2.5))
        assert gap >= env.settings.robot.radius


def test_the_map_for_a_file_knows_the_floor_that_was_seen():
    env = made()
    assert env.belief("robot_0").sparse_map.seen_m2 > 0.0
    known = turned_round(env, 20).belief("robot_0").sparse_map
    kept = env.perception.sparse_maps.made[0].record
    bears = kept.seen_floor.supports(0.05).bears
    ground, told = known.navigation.ground, {SEEN: 0, UNKNOWN: 0}
    offsets = np.stack(np.meshgrid(*2 * [np.linspace(-0.2, 0.2, 9)]), axis=-1).reshape(-1, 2)
    for place in np.random.default_rng(0).uniform((0.2, 0.2), (6.8, 3.8), (400, 2)):
        around = ground.levels[tuple(ground.cells_of(place + offsets).T)]
        for level, is_borne in ((SEEN, True), (UNKNOWN, False)):
            if (around == level).all():
                assert bears(place) == is_borne
                told[level] += 1
    assert min(told.values()) > 20


def test_codes_of_the_thesis_are_points_and_plans_lead_round_them():
    env = turned_round(made(sparse_map={"mode": "thesis"}))
    belief = env.belief("robot_0")
    boxes = belief.sparse_map.navigation.index.boxes
    assert len(boxes) > 20
    assert np.array_equal(boxes[:, :3], boxes[:, 3:])
    route = belief.sparse_map.route(belief.pose[:2], in_frame(env, 4.6, 1.0))
    assert len(route.points) > 2


def test_a_robot_without_a_camera_has_no_sparse_map():
    env = lidarium.parallel_env(HALL, robots=1, starts="fixed")
    env.reset(seed=0)
    with pytest.raises(ValueError, match=r"no depth camera.*camera='xtion'"):
        _ = env.belief("robot_0").sparse_map


def test_a_camera_that_sees_no_ground_is_refused():
    env = made(camera={"pitch": -0.8})
    with pytest.raises(ValueError, match="sees the ground only from inf m on"):
        _ = env.belief("robot_0").sparse_map


def test_images_belong_to_the_poses_at_which_they_were_taken():
    slow = made(camera={"pitch": 0.35, "rate_hz": 1.0})
    mapper = slow.perception.sparse_maps.of(0)
    assert len(mapper.ground) == 1
    for step in range(1, 31):
        slow.step({"robot_0": np.array([0.0, 0.5], np.float32)})
        assert slow.simulation.camera.taken_at[0] == step // 10 * 10
        assert len(mapper.ground) == 1 + step // 10
    poses = np.array(mapper.ground._poses.rows)
    assert poses[-1] == pytest.approx(slow.world.poses[0])


def test_robots_that_know_each_other_do_not_map_each_other():
    facing = Floor("facing", (0.0, 0.0, 6.0, 4.0), starts=np.array([[1.0, 2.0, 0.0], [3.0, 2.0, math.pi]]))
    env = made(facing, robots=2, known_starts=True)
    unknown = made(facing, robots=2, known_starts=False, localization="odometry")
    for one, has_bodies in ((env, False), (unknown, True)):
        mapper = one.perception.sparse_maps.of(0)
        turned_round(one)
        # In the frame of the floor; without known starts the map begins where the robot does.
        assert mapper.axes == 0.0
        shift = (1.0, 2.0) if has_bodies else (0.0, 0.0)
        middles = mapper.map.boxes.mean(axis=1)[:, :2] + shift
        inside = (np.abs(middles - (3.0, 2.0)) < (2.5, 1.5)).all(axis=1)
        assert inside.any() == has_bodies


def test_a_team_that_shares_its_map_plans_on_what_all_have_seen():
    env = made(robots=2)
    own = [env.belief(agent).sparse_map for agent in env.agents]
    shared = [env.belief(agent).shared_sparse_map for agent in env.agents]
    for row, (alone, together) in enumerate(zip(own, shared, strict=True)):
        assert together.seen_m2 > alone.seen_m2
        other, shift = own[1 - row], env.perception.poses.offset(1 - row) - env.perception.poses.offset(row)
        ground = other.navigation.ground
        seen = other.frame.apply(ground.centres(np.argwhere(ground.levels == SEEN))) + shift
        assert not together.are_unknown(seen).any()
    apart = made(robots=2, known_starts=False, localization="odometry")
    alone = apart.belief("robot_0")
    assert alone.shared_sparse_map.seen_m2 == alone.sparse_map.seen_m2


@pytest.mark.parametrize("heading", [0.0, 0.3, 0.75, -2.4])
def test_the_axes_of_a_map_are_those_of_the_walls(heading):
    turned = Floor("turned", HALL.bounds, HALL.solids, starts=np.array([[1.0, 2.0, heading]]))
    env = made(turned, known_starts=False, localization="odometry")
    mapper = env.perception.sparse_maps.of(0)
    # The robot takes its first heading for 0.
    apart = math.remainder(mapper.axes + heading, math.pi / 2)
    assert abs(apart) < 0.02
    assert abs(mapper.axes) <= math.pi / 4 + 1e-9
    turned_round(env)
    walls = mapper.map.boxes[np.ptp(mapper.map.boxes[:, :, 2], axis=1) > 0.2]
    thickness = np.ptp(walls[:, :, :2], axis=1).min(axis=1)
    assert np.median(thickness) < 0.05
    x, y, _ = turned.starts[0]
    frame = Transform(x, y, heading)
    belief = env.belief("robot_0").sparse_map
    table = np.array([[3.1, 2.0], [3.1, 1.7]])
    assert not belief.are_unknown(frame.inverse().apply(table)).any()
    route = belief.route(np.zeros(2), frame.inverse().apply([4.6, 1.0]))
    for x, y in frame.apply(route.points):
        gap = math.hypot(max(3.0 - x, 0, x - 4.0), max(1.5 - y, 0, y - 2.5))
        assert gap >= env.settings.robot.radius


def test_where_no_wall_is_seen_the_axes_are_those_of_the_poses():
    mapper = SparseMapper(make_settings(robots=1, camera={**SMALL}, observe=["depth"]))
    pose = np.array([0.0, 0.0, 0.6])
    mapper.sense(0.0, pose, depth_image(mapper.ground.camera, pose), NOBODY)
    assert mapper.axes == 0.0


def test_what_a_robot_is_asked_and_answers_is_in_its_map_frame():
    env = made()
    belief = env.belief("robot_0")
    assert not belief.sparse_map.has_moved
    turned_round(env)
    known = belief.sparse_map
    place = in_frame(env, 2.0, 3.0)
    assert known.route(belief.pose[:2], place).points[-1] == pytest.approx(place)
    assert known.is_free(place[None])
    assert not known.amid(place[None], 0.1, 0.5).is_free(place[None])
    assert known.amid(np.empty((0, 2)), 0.1, 0.5) is known
    assert np.linalg.norm(known.nearest_standing(place, 0.5) - place) < 0.4
    assert known.nearest_standing(in_frame(env, 50.0, 50.0), 1.0) is None
    borders = known.unknown_ground(0.3)
    assert borders
    for border in borders:
        assert known.are_unknown(border).all()
    view = known.nearest_view(belief.pose, borders[0], Sight(0.3, 2.0, 3.0, 0.5, 0.0, 0.1, 0.5, 0.2, 0.3, 4.0, 0.3))
    assert math.dist(view.place, belief.pose[:2]) < 8.0
    assert view.points == pytest.approx(borders[0])
    assert known.are_unknown(known.unknown_samples()).all()
    assert not known.has_moved
    assert known.corrections == 0


def test_what_has_moved_is_forgotten_when_seen_through_and_what_stands_is_not():
    camera = {**SMALL, "columns": 128, "rows": 96}
    mapper = SparseMapper(make_settings(robots=1, camera=camera, observe=["depth"]), axes=0.0)
    wall, moves = [[3.2, -3.0, 0.0], [3.4, 3.0, 1.0]], [[1.8, -0.2, 0.0], [2.2, 0.2, 0.45]]
    pose = np.zeros(3)
    mapper.sense(0.0, pose, depth_image(mapper.ground.camera, pose, [wall, moves]), NOBODY)
    before = mapper.map.boxes
    is_thing = before[:, 0, 0] < 2.5
    assert is_thing.any()
    nearer = np.array([0.1, 0.0, 0.0])
    mapper.sense(0.1, nearer, depth_image(mapper.ground.camera, nearer, [wall, moves]), NOBODY)
    assert len(mapper.map.boxes) == len(before), "it still stands there"
    nearer = np.array([0.2, 0.0, 0.0])
    mapper.sense(0.2, nearer, depth_image(mapper.ground.camera, nearer, [wall]), NOBODY)
    left = mapper.map.boxes
    assert not (left[:, 0, 0] < 2.5).any()
    assert (left[:, 0, 0] > 2.5).sum() == (~is_thing).sum()


# -- Corrected poses -------------------------------------------------------------------------------------


def mapped_along(poses):
    """A mapper that went along poses, and the images that it took."""
    mapper = SparseMapper(make_settings(robots=1, camera={**SMALL}, observe=["depth"]), axes=0.0)
    boxes = [[[2.0, -1.0, 0.0], [2.4, -0.4, 0.6]]]
    for k, pose in enumerate(poses):
        mapper.sense(0.1 * k, pose, depth_image(mapper.ground.camera, pose, boxes), NOBODY)
    return mapper


SMALL = {"columns": 64, "rows": 48, "pitch": 0.35}
WAY = np.array([[0.05 * k, 0.02 * k, 0.03 * k] for k in range(20)])


def scans_at(times, poses):
    return KeyScans(poses, np.zeros((len(poses), 4), np.float32), np.asarray(times))


def test_a_correction_that_moves_nothing_changes_nothing():
    mapper = mapped_along(WAY)
    boxes, free, trail = mapper.map.boxes.copy(), mapper.map.free.copy(), mapper.trail
    seen = int(mapper.ground.cells.sum())
    mapper.correct(scans_at(0.1 * np.arange(0, 20, 4), WAY[::4]))
    assert mapper.map.boxes == pytest.approx(boxes, abs=1e-9)
    assert mapper.map.free == pytest.approx(free, abs=1e-9)
    assert mapper.trail == pytest.approx(trail, abs=1e-12)
    assert abs(int(mapper.ground.cells.sum()) - seen) <= 2, "but for cells on a border, by rounding"
    assert mapper.corrections == 1


def test_all_that_was_mapped_moves_with_the_scan_before_it():
    mapper = mapped_along(WAY)
    motion = np.array([0.4, -0.3, 0.5])
    free, trail = mapper.map.free.copy(), mapper.trail
    seen = mapper.ground.cells.copy()
    mapper.correct(scans_at(0.1 * np.arange(0, 20, 4), composed(motion, WAY[::4])))
    turn = np.array([[np.cos(0.5), -np.sin(0.5)], [np.sin(0.5), np.cos(0.5)]])
    assert mapper.map.free[:, :2] == pytest.approx(free[:, :2] @ turn.T + motion[:2])
    assert mapper.trail[:, :2] == pytest.approx(trail[:, :2] @ turn.T + motion[:2])
    assert mapper.ground.cells.sum() == pytest.approx(seen.sum(), rel=0.05)


def test_parts_of_the_past_move_by_themselves_and_again():
    mapper = mapped_along(WAY)
    before = mapper._poses.rows.copy()
    times = np.array([0.0, 1.0])
    for shift in (0.5, 0.8):
        keys = np.array([before[0], before[10] + (0.0, shift, 0.0)])
        mapper.correct(scans_at(times, keys))
        after = mapper._poses.rows
        assert after[:10] == pytest.approx(before[:10])
        assert after[10:] == pytest.approx(before[10:] + np.array([0.0, shift, 0.0]))
    mapper.correct(scans_at([0.55], before[:1]))
    assert mapper._poses.rows[:10] == pytest.approx(before[:10]), "no step was taken at that time"


def test_slam_says_of_when_its_scans_are_and_where_they_were_believed():
    env = lidarium.parallel_env(
        "apartment", robots=1, camera="depth_64x48", realism="lab", stop_coverage=None, map_cells=32, starts="fixed"
    )
    env.reset(seed=0)
    mapper = env.perception.sparse_maps.of(0)
    for step in range(150):
        env.step({"robot_0": np.array([0.4, 0.3 if step % 40 < 20 else -0.3], np.float32)})
    localizer = env.perception.poses.localizers[0]
    scans = localizer.key_scans
    times = mapper._times.rows
    assert np.all(np.diff(scans.times_s) > 0.0)
    steps = np.searchsorted(times, scans.times_s)
    assert times[steps].tolist() == scans.times_s.tolist()
    if localizer.counts.corrections == 0:
        assert mapper._poses.rows[steps] == pytest.approx(scans.poses, abs=1e-9)
    last = relative(scans.poses[-1], mapper._poses.rows[-1])
    assert np.hypot(*last[:2]) < 0.5


def test_a_map_follows_the_corrections_of_slam():
    env = made("apartment", realism="lab", camera="depth_64x48")
    mapper = env.perception.sparse_maps.of(0)
    localizer = env.perception.poses.localizers[0]
    for step in range(900):
        env.step({"robot_0": np.array([0.5 if step % 60 < 30 else 0.0, 0.45], np.float32)})
        if mapper.corrections:
            break
    assert mapper.corrections == 1
    assert localizer.counts.corrections == 1
    scans = localizer.key_scans
    steps = np.searchsorted(mapper._times.rows, scans.times_s)
    assert mapper._poses.rows[steps] == pytest.approx(scans.poses, abs=1e-6)


def test_the_tilted_camera_is_the_other_one_looking_down():
    tilted = CAMERAS["xtion_tilted"]
    assert tilted.pitch == pytest.approx(math.radians(20.0))
    assert tilted.columns == CAMERAS["xtion"].columns
