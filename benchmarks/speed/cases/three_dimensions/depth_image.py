"""Depth images of one robot, beside PyBullet's getCameraImage, and depth in batches."""

import itertools
from dataclasses import replace

import numpy as np

import lidarium
from lidarium.benchmarks.speed.harness.lines import Line, faster, shown
from lidarium.benchmarks.speed.harness.report import run_alone
from lidarium.benchmarks.speed.harness.timing import Contender, Effort, interleaved, rate, repeated
from lidarium.benchmarks.speed.peers.bullet import bullet_images
from lidarium.envs.floors.catalogue.names import load_floor
from lidarium.envs.floors.faces import faces_of
from lidarium.envs.floors.floor import Floor
from lidarium.envs.floors.free_space import configuration_space
from lidarium.envs.settings.cameras import CAMERAS, DepthCamera
from lidarium.envs.settings.robots import ROBOTS
from lidarium.envs.simulation.depth.frames import image_of

CORES = 1
POSES, EPISODES, ROBOTS_EACH = 64, 64, 2
LARGE = "office:7", "office:11", "office:13", "office:17"
SHARE_WITH_DEPTH = 0.6

RENDERERS = {"TinyRenderer": 150.0, "EGL": None}
"""PyBullet's renderers, and how many times as fast an image of 320 x 240 has to be."""

OBSERVED = {"all": ("scan", "pose", "velocity", "bumper", "map"), "pose and scan": ("scan", "pose")}
"""What batches observe beside depth: all that is observed by default, or little."""

LIMITS_S = {("apartment", 320): 0.12e-3, ("apartment", 640): 0.35e-3, ("large", 320): 0.25e-3, ("large", 640): 0.6e-3}
"""Longest that an image may take [s], by floor and columns."""

NOTES = (
    "*Depth images*: the Xtion (58 deg, 0.4 to 4 m) at 64 free places of an apartment with 80 solids and of about "
    f"2,000 m2 of offices (*large*). *getCameraImage* is PyBullet's. *With depth*: a batch of {EPISODES} episodes x "
    f"{ROBOTS_EACH} robots that observes 64 x 48 depths, over the same batch without depth.",
)


def large_floor() -> Floor:
    """Return about 2,000 m2 of offices, side by side."""
    parts = [load_floor(name) for name in LARGE]
    starts = np.cumsum([0.0, *(part.bounds[2] for part in parts)])
    solids = [
        replace(solid, polygon=solid.polygon + np.array([start, 0.0]))
        for part, start in zip(parts, starts, strict=False)
        for solid in part.solids
    ]
    bounds = (0.0, 0.0, float(starts[-1]), max(part.bounds[3] for part in parts))
    return Floor("large", bounds, tuple(solids))


def places_on(floor: Floor) -> np.ndarray:
    """Return free poses (POSES, 3) on a floor."""
    generator = np.random.default_rng(0)
    raster = floor.raster(0.05, 0.05, 0.52)
    rows, columns = np.nonzero(configuration_space(raster, ROBOTS["kobuki"].radius))
    chosen = generator.integers(0, len(rows), POSES)
    x = raster.origin[0] + (columns[chosen] + 0.5) * raster.resolution
    y = raster.origin[1] + (rows[chosen] + 0.5) * raster.resolution
    return np.stack([x, y, generator.uniform(-np.pi, np.pi, POSES)], axis=1)


def our_images(floor: Floor, camera: DepthCamera, poses: np.ndarray) -> Contender:
    """Take the image of each pose in turn."""
    faces, bodies = faces_of(floor), ROBOTS["kobuki"].numbers[None]
    level, turns = np.zeros((1, 3)), itertools.cycle(poses[:, None])

    def take() -> None:
        image_of(faces, next(turns), level, bodies, 0, camera)

    take()
    return repeated(take, 1)


def batch(observe: tuple[str, ...], has_depth: bool) -> Contender:
    """Step a batch that observes something, with or without depth; a unit is an agent step."""
    options = {"camera": "depth_64x48", "observe": (*observe, "depth")} if has_depth else {"observe": observe}
    env = lidarium.vector_env(EPISODES, "apartment", robots=ROBOTS_EACH, copy=False, horizon_s=None, **options)
    env.reset(seed=0)
    actions = np.random.default_rng(0).uniform(-1.0, 1.0, (EPISODES * ROBOTS_EACH, 2)).astype(np.float32)

    def step() -> None:
        env.step(actions)

    step()
    return repeated(step, EPISODES * ROBOTS_EACH)


def measure(effort: Effort) -> list[Line]:
    """Compare depth images, and batches with and without depth."""
    floors = {"apartment": load_floor("apartment"), "large": large_floor()}
    contenders: dict[str, Contender] = {}
    for name, floor in floors.items():
        poses = places_on(floor)
        for camera in (CAMERAS["xtion"], CAMERAS["xtion_vga"]):
            contenders[f"{name} {camera.columns}"] = our_images(floor, camera, poses)
            for renderer in RENDERERS if name == "apartment" else ():
                peer = bullet_images(floor, camera, poses, renderer == "EGL")
                if peer is not None:
                    contenders[f"{renderer} {camera.columns}"] = repeated(peer, 1)
    for name, observe in OBSERVED.items():
        contenders[f"{name} without"] = batch(observe, False)
        contenders[f"{name} with"] = batch(observe, True)
    seconds = interleaved(contenders, effort)
    lines = []
    for (name, columns), limit in LIMITS_S.items():
        title = f"depth image, {columns} x {columns * 3 // 4}, {name}"
        spent = seconds[f"{name} {columns}"]
        taken = 1.0 / rate(spent)
        lines.append(Line(title, f"{shown(1e3 * taken)} ms", "-", None, 1e3 * limit, 1e3 * taken, True, "ms"))
        if name == "apartment":
            for renderer, wanted in RENDERERS.items():
                to_reach = wanted if columns == 320 else None
                peer_name, taken_by_peer = f"getCameraImage, {renderer}", seconds.get(f"{renderer} {columns}")
                lines.append(faster(title, spent, peer_name, taken_by_peer, to_reach, "images/s"))
    for name, wanted in (("all", SHARE_WITH_DEPTH), ("pose and scan", None)):
        lines.append(
            faster(
                f"batch of {EPISODES} x {ROBOTS_EACH} robots with depth 64 x 48, beside {name}",
                seconds[f"{name} with"],
                "without depth",
                seconds[f"{name} without"],
                wanted,
            )
        )
    return lines


if __name__ == "__main__":
    run_alone(measure, "Depth images beside PyBullet, and depth in batches.")
