"""Depth images agree with rays through the centres of their pixels."""

import math
from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.floors.floor import Floor, Solid
from lidarium.envs.floors.generation.furniture import place
from lidarium.envs.settings.cameras import CAMERAS, DepthCamera
from lidarium.envs.settings.making import make_settings
from lidarium.envs.simulation.depth.point_cloud import camera_pose, point_cloud

BOUNDS = (0.0, 0.0, 6.0, 5.0)


def prisms(generator, count=12):
    """Convex prisms here and there, some of them on the ground or up to the ceiling."""
    solids = []
    for _ in range(count):
        points = generator.uniform(-0.5, 0.5, (6, 2)) + generator.uniform((0.6, 0.6), (5.4, 4.4))
        low, high = np.sort(generator.uniform(-0.2, 2.8, 2))
        solids.append(Solid(points[ConvexHull(points).vertices], low, high + 0.05))
    return tuple(solids)


def half_spaces(solids, bodies, ceiling=2.5):
    """Convex bodies as half-spaces n . x <= d: solids and upright cylinders of many sides."""
    rings = [(solid.polygon, max(solid.z_low, 0.0), min(solid.z_high, ceiling)) for solid in solids]
    angles = np.linspace(0.0, 2.0 * math.pi, 720, endpoint=False)
    rings += [(np.stack([x + r * np.cos(angles), y + r * np.sin(angles)], axis=1), 0.0, h) for x, y, r, h in bodies]
    for ring, low, high in rings:
        if low < high:
            edges = np.roll(ring, -1, axis=0) - ring
            normals = np.stack([edges[:, 1], -edges[:, 0], np.zeros(len(ring))], axis=1)
            offsets = (normals[:, :2] * ring).sum(axis=1)
            sign = 1.0 if (normals[:, :2] @ ring.mean(axis=0) <= offsets).all() else -1.0
            yield (
                np.vstack([sign * normals, (0, 0, 1), (0, 0, -1)]),
                np.concatenate([sign * offsets, [high, -low]]),
            )


def depths_of_rays(solids, bodies, pose, camera):
    """Depths of the pixels' rays, by clipping each against each body."""
    transform = camera_pose(camera)
    c, s = math.cos(pose[2]), math.sin(pose[2])
    world = np.array([(c, -s, 0.0), (s, c, 0.0), (0.0, 0.0, 1.0)])
    eye = world @ transform[:3, 3] + (pose[0], pose[1], 0.0)
    pinhole = camera.intrinsics
    u, v = np.meshgrid(np.arange(camera.columns), np.arange(camera.rows))
    rays = np.stack([(u - pinhole.cx) / pinhole.fx, (v - pinhole.cy) / pinhole.fy, np.ones(u.shape)], axis=-1)
    rays = rays @ (world @ transform[:3, :3]).T
    depth = np.full(u.shape, np.inf)
    room = [
        ((1, 0, 0), BOUNDS[2]),
        ((-1, 0, 0), -BOUNDS[0]),
        ((0, 1, 0), BOUNDS[3]),
        ((0, -1, 0), -BOUNDS[1]),
    ]
    with np.errstate(divide="ignore", invalid="ignore"):
        for normal, offset in [*room, ((0, 0, 1), 2.5), ((0, 0, -1), 0.0)]:
            along = rays @ np.array(normal)
            depth = np.where(along > 0.0, np.minimum(depth, (offset - eye @ normal) / along), depth)
        for normals, offsets in half_spaces(solids, bodies):
            along, gap = rays @ normals.T, offsets - normals @ eye
            ends = gap / along
            enters = np.where(along < 0.0, ends, -np.inf).max(axis=-1)
            leaves = np.where(along > 0.0, ends, np.inf).min(axis=-1)
            met = (enters <= leaves) & (enters > 0.0)
            met &= ~((along == 0.0) & (gap < 0.0)).any(axis=-1)
            depth = np.where(met, np.minimum(depth, enters), depth)
    return np.where((depth >= camera.depth_min) & (depth < camera.depth_max), depth, 0.0)


def environment(floor, camera, **options):
    options = {"robots": 1, "observe": ["depth"], "stop_coverage": None, **options}
    return ExplorationEnv(floor, make_settings(camera=camera, **options))


def is_outside(solids, x, y):
    floor = Floor("probe", BOUNDS, solids)
    raster = floor.raster(0.025, 0.05, 0.52)
    column, row = int((x - raster.origin[0]) / 0.025), int((y - raster.origin[1]) / 0.025)
    return not raster.solid[row - 10 : row + 11, column - 10 : column + 11].any()


@pytest.mark.parametrize("seed", range(6))
def test_a_frame_has_the_depths_of_rays(seed):
    generator = np.random.default_rng(seed)
    solids = prisms(generator)
    places = (p for p in generator.uniform((0.5, 0.5), (5.5, 4.5), (500, 2)) if is_outside(solids, *p))
    first, second = next(places), None
    while second is None or np.hypot(*(second - first)) < 0.5:
        second = next(places)
    camera = DepthCamera(
        columns=81,
        rows=60,
        depth_max=6.0,
        forward=0.1,
        left=-0.05,
        pitch=generator.uniform(-0.6, 0.9),
        pan=generator.uniform(-3.0, 3.0),
        field_of_view=generator.uniform(0.5, 2.0),
    )
    towards = math.atan2(*(second - first)[::-1]) - camera.pan
    starts = np.array([[*first, towards], [*second, 0.3]])
    env = environment(Floor("prisms", BOUNDS, solids), camera, robots=2)
    observations, _ = env.reset(seed=0, options={"starts": starts})
    body = env.settings.robot
    expected = depths_of_rays(solids, [(*second, body.radius, body.height)], env.world.poses[0], camera)
    depth = observations["robot_0"]["depth"][0]
    gaps = np.abs(depth - expected)
    assert (depth > 0.0).mean() > 0.3
    assert (gaps < 1e-3).mean() >= 0.995
    assert np.median(gaps) < 1e-6


def test_a_level_camera_sees_wall_and_ground_where_they_are():
    camera = DepthCamera(columns=64, rows=48, depth_max=10.0)
    env = environment(Floor("room", BOUNDS), camera)
    observations, infos = env.reset(seed=0, options={"starts": [[2.0, 2.5, 0.0]]})
    depth = observations["robot_0"]["depth"][0]
    assert depth[24] == pytest.approx(np.full(64, 4.0), abs=1e-5)
    cloud = point_cloud(depth, camera)
    bottom = cloud[-64:]
    assert np.abs(bottom[:, 2]).max() < 1e-5
    assert np.abs(cloud[:, 0].max() - 4.0) < 1e-5
    assert infos["robot_0"]["camera"]["intrinsics"]["cx"] == 31.5


def test_a_table_top_is_seen_by_the_camera_and_missed_by_the_laser():
    solids = place("table", 3.0, 2.5, math.pi / 2, 1.4, 0.8)
    camera = DepthCamera(columns=64, rows=48, depth_max=6.0)
    env = environment(Floor("table", BOUNDS, solids), camera)
    observations, _ = env.reset(seed=0, options={"starts": [[1.0, 2.5, 0.0]]})
    cloud = point_cloud(observations["robot_0"]["depth"], camera)
    top = cloud[(np.abs(cloud[:, 2] - 0.725) < 0.03) & (cloud[:, 0] < 1.5)]
    assert len(top) > 20
    straight = env.world.sensors["scan"][0, env.settings.lidar.beams // 2]
    assert straight == pytest.approx(5.0, abs=0.03)


def test_what_is_too_near_or_too_far_is_no_measurement():
    wall = Solid(np.array([(2.5, 1.0), (2.6, 1.0), (2.6, 4.0), (2.5, 4.0)]))
    camera = DepthCamera(columns=32, rows=24, depth_min=0.6, depth_max=1.0, field_of_view=0.3)
    for x, expected in ((2.1, 0.0), (1.7, 0.8), (1.3, 0.0)):
        env = environment(Floor("wall", BOUNDS, (wall,)), camera)
        observations, _ = env.reset(seed=0, options={"starts": [[x, 2.5, 0.0]]})
        assert observations["robot_0"]["depth"] == pytest.approx(np.full((1, 24, 32), expected), abs=1e-5)


def test_noise_has_the_deviation_of_the_settings_and_comes_from_the_seed():
    camera = DepthCamera(columns=200, rows=150, depth_max=6.0, noise_floor=0.01, noise_share=0.005, field_of_view=0.2)
    room = Floor("room", BOUNDS)
    images = {}
    for seed in (1, 1, 2):
        env = environment(room, camera)
        observations, _ = env.reset(seed=seed, options={"starts": [[1.0, 2.5, 0.0]]})
        image = observations["robot_0"]["depth"][0].copy()
        assert (images.setdefault(seed, image) == image).all()
    assert (images[1] != images[2]).any()
    middle = images[1] - 5.0
    assert middle.mean() == pytest.approx(0.0, abs=0.003)
    assert middle.std() == pytest.approx(0.01 + 0.005 * 4.6**2, rel=0.03)


def test_rounded_disparities_leave_steps_that_grow_with_depth():
    camera = DepthCamera(columns=64, rows=48, depth_max=6.0, disparity_step=1.0 / 345.0)
    env = environment(Floor("room", BOUNDS), camera)
    observations, _ = env.reset(seed=0, options={"starts": [[1.5, 2.5, 0.3]]})
    depth = observations["robot_0"]["depth"]
    disparities = 345.0 / depth[depth > 0.0]
    assert np.abs(disparities - np.round(disparities)).max() < 1e-3


def test_an_image_is_taken_at_the_rate_of_the_camera():
    camera = DepthCamera(columns=16, rows=12, rate_hz=2.5)  # every fourth step of 0.1 s
    env = environment("apartment", camera)
    observations, _ = env.reset(seed=0)
    images = [observations["robot_0"]["depth"].copy()]
    for _ in range(8):
        observations, *_ = env.step({"robot_0": np.array([0.3, 0.6])})
        images.append(observations["robot_0"]["depth"].copy())
    is_new = [bool((a != b).any()) for a, b in pairwise(images)]
    assert is_new == [False, False, False, True] * 2


def test_a_camera_on_a_robot_that_has_ended_takes_no_image():
    env = environment("apartment", CAMERAS["depth_64x48"], robots=2)
    env.reset(seed=0)
    env.stop("robot_0", "no_frontier")
    forward = {agent: np.array([0.4, 0.4]) for agent in env.agents}
    env.step(forward)
    before = env.simulation.sensors["depth"].copy()
    env.step({"robot_1": np.array([0.4, 0.4])})
    after = env.simulation.sensors["depth"]
    assert (after[0] == before[0]).all()
    assert (after[1] != before[1]).any()


@pytest.mark.parametrize(
    ("camera", "message"),
    [
        ({"columns": 0}, "columns of the camera is 0"),
        ({"depth_min": 5.0}, "depth_min of the camera is 5.0 m"),
        ({"forward": 0.5}, "beyond the robot's radius"),
        ({"height": 1.0}, "above the robot's height"),
        ({"field_of_view": math.nan}, "field_of_view of the camera is nan"),
    ],
)
def test_cameras_that_cannot_be_are_refused(camera, message):
    with pytest.raises(ValueError, match=message):
        make_settings(camera=camera)


def test_depth_without_a_camera_is_refused():
    with pytest.raises(ValueError, match="needs a camera"):
        make_settings(observe=["scan", "depth"])
