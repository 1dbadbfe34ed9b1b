"""Quantisation of clouds, beside scikit-learn and faiss."""

import importlib
import importlib.util
import os
import warnings
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.benchmarks.speed.harness.lines import Line, faster, shown
from lidarium.benchmarks.speed.harness.report import run_alone
from lidarium.benchmarks.speed.harness.timing import Contender, Effort, interleaved, rate, repeated
from lidarium.envs.floors.catalogue.names import load_floor
from lidarium.envs.floors.faces import faces_of
from lidarium.envs.floors.free_space import configuration_space
from lidarium.envs.settings.cameras import CAMERAS
from lidarium.envs.settings.robots import ROBOTS
from lidarium.envs.simulation.depth.frames import image_of
from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.point_clouds.cameras import Intrinsics, base_from_camera, map_from_base, moved, points_of_depth
from lidarium.mapping.point_clouds.cloud_files import read_cloud
from lidarium.mapping.point_clouds.point_cloud import PointCloud
from lidarium.mapping.sparse.quantisation.lloyd import nearest_codes
from lidarium.mapping.sparse.quantisation.quantiser import QuantisationSettings, quantise
from lidarium.mapping.sparse.quantisation.tiles import tiles_of

Points = NDArray[np.float32]
Quantiser = Callable[[], NDArray[np.floating]]
"""Takes Lloyd's steps, labels every point, and returns the codes, shape (k, 3)."""


def scikit_learn_steps(points: Points, start: Points, steps: int) -> Quantiser | None:
    """Return the quantiser of scikit-learn; None if it is not installed."""
    if importlib.util.find_spec("sklearn") is None:
        return None
    cluster: Any = importlib.import_module("sklearn.cluster")
    limits: Any = importlib.import_module("threadpoolctl")

    def quantise() -> NDArray[np.floating]:
        with limits.threadpool_limits(1):
            model = cluster.KMeans(len(start), init=start, n_init=1, max_iter=steps, tol=0.0, algorithm="lloyd")
            codes: NDArray[np.floating] = model.fit(points).cluster_centers_
        return codes

    return quantise


def faiss_steps(points: Points, start: Points, steps: int) -> Quantiser | None:
    """Return the quantiser of faiss; None if it is not installed."""
    if importlib.util.find_spec("faiss") is None:
        return None
    faiss: Any = importlib.import_module("faiss")

    def quantise() -> NDArray[np.floating]:
        faiss.omp_set_num_threads(1)
        model = faiss.Kmeans(3, len(start), niter=steps, max_points_per_centroid=len(points))
        model.train(points, init_centroids=start)
        model.index.search(points, 1)
        codes: NDArray[np.floating] = model.centroids
        return codes

    return quantise


CORES = 1
FRAME, FLOOR, CODES, STEPS = 307_200, 2_570_000, 512, 7
NOISE_M = 0.005
BUDGET_S, FRAMES = 0.25, 5
REAL, SIMULATED = "real depth images", "simulated ones"

LIMITS_S = {
    f"K-means++, {CODES} codes, {FRAME:,} points": 0.030,
    f"K-means++, 32 codes, {FRAME:,} points": 0.012,
    f"K-means++, {CODES} codes, {FLOOR:,} points": 0.25,
    f"LBG, {CODES} codes, {FRAME:,} points": 0.1,
}
"""Longest that a quantisation may take [s]."""

LEAST_RATIOS = {"scikit-learn": 30.0, "faiss": 3.0}
MOST_PHI = {"phi2": 0.94, "phi1": 0.975}

NOTES = (
    f"*Quantisation*: the whole call with {STEPS} of Lloyd's steps on points of depth images of the furnished "
    "apartment. Peers start from the same codes and make as many steps on one thread. *Error over theirs*: of mean "
    f"squared distances. *Budget*: the error after {BUDGET_S} s over that of K-means++, the mean over {FRAMES} real "
    f"(7-Scenes kitchen in LIDARIUM_DATA; judged) and {FRAMES} simulated depth images.",
)


def floor_points(count: int) -> np.ndarray:
    """Return points that a robot's camera sees in the apartment, (count, 3) float32."""
    generator, floor = np.random.default_rng(0), load_floor("apartment")
    camera = replace(CAMERAS["xtion_vga"], depth_min=0.05, depth_max=50.0, noise_floor=0.0, noise_share=0.0)
    faces, robot = faces_of(floor), ROBOTS["kobuki"]
    raster = floor.raster(0.05, 0.05, 0.52)
    rows, columns = np.nonzero(configuration_space(raster, robot.radius))
    mount = base_from_camera(camera.forward, camera.left, camera.height)
    parts: list[np.ndarray] = []
    while sum(map(len, parts)) < count:
        chosen = generator.integers(0, len(rows))
        x = raster.origin[0] + (columns[chosen] + 0.5) * raster.resolution
        y = raster.origin[1] + (rows[chosen] + 0.5) * raster.resolution
        pose = np.array([[x, y, generator.uniform(-np.pi, np.pi)]])
        depth = image_of(faces, pose, np.zeros((1, 3)), robot.numbers[None], 0, camera)
        cloud = PointCloud(points_of_depth(depth, camera.intrinsics))
        parts.append(moved(cloud, map_from_base(Transform(*pose[0])) @ mount).points)
    points = np.concatenate(parts)[:count]
    return (points + generator.normal(0.0, NOISE_M, points.shape)).astype(np.float32)


def quantised(points: np.ndarray, codes: int, settings: QuantisationSettings) -> Contender:
    """Quantise points once a unit."""
    return repeated(lambda: quantise(points, codes, settings), 1)


def measure(effort: Effort) -> list[Line]:
    """Time quantisation, compare Lloyd's steps, measure what a budget gains."""
    frame, floor = floor_points(FRAME), floor_points(FLOOR)
    plain, split = QuantisationSettings(steps=STEPS), QuantisationSettings("lbg", steps=STEPS)
    asked = ((frame, CODES, plain), (frame, 32, plain), (floor, CODES, plain), (frame, CODES, split))
    contenders = dict(zip(LIMITS_S, (quantised(*each) for each in asked), strict=True))
    start = frame[np.random.default_rng(0).choice(len(frame), CODES, replace=False)]
    contenders["ours"] = repeated(lambda: quantise(frame, CODES, plain, start=start), 1)
    found = {"scikit-learn": scikit_learn_steps(frame, start, STEPS), "faiss": faiss_steps(frame, start, STEPS)}
    peers = {name: quietly(peer) for name, peer in found.items() if peer is not None}
    contenders |= {name: repeated(peer, 1) for name, peer in peers.items()}
    seconds = interleaved(contenders, effort)
    lines = []
    for name, limit in LIMITS_S.items():
        taken = 1e3 / rate(seconds[name])
        lines.append(Line(name, f"{shown(taken)} ms", "-", None, 1e3 * limit, taken, True, "ms"))
    title = f"Lloyd's steps from the same {CODES} codes"
    error = quantise(frame, CODES, plain, start=start).phi2
    for name, wanted in LEAST_RATIOS.items():
        lines.append(faster(title, seconds["ours"], name, seconds.get(name), wanted, "clouds/s"))
        if name in peers:
            ratio = error / error_of(frame, np.asarray(peers[name](), np.float32))
            lines.append(Line(f"{title}, error over theirs", "-", name, None, 1.001, ratio, True))
    simulated = {f"{place}": points for place, points in enumerate(np.split(floor[: FRAMES * FRAME], FRAMES))}
    return [*lines, *budget_lines(real_frames(), REAL), *budget_lines(simulated, SIMULATED)]


def quietly(peer: Callable[[], np.ndarray]) -> Callable[[], np.ndarray]:
    """Return a peer that warns of nothing: it is asked to end before it converges."""

    def quantising() -> np.ndarray:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return peer()

    return quantising


def error_of(points: np.ndarray, codes: np.ndarray) -> float:
    """Return the mean squared distance of points to the nearest of codes [m2]."""
    tiles = tiles_of(points)
    nearest = nearest_codes(tiles, np.ascontiguousarray(codes))
    return float(nearest.group_errors.sum()) / len(points)


def real_frames() -> dict[str, np.ndarray]:
    """Return points of real depth images by name; none if there are no data."""
    beside = Path(__file__).resolve().parents[5] / "shared" / "data"
    folder = Path(os.environ.get("LIDARIUM_DATA", beside)) / "clouds" / "redkitchen"
    pinhole = Intrinsics(585.0, 585.0, 320.0, 240.0)
    paths = sorted(folder.glob("*.depth.png"))[:FRAMES]
    return {path.stem: read_cloud(path, intrinsics=pinhole).points for path in paths}


def budget_lines(clouds: Mapping[str, np.ndarray], what: str) -> list[Line]:
    """Compare errors after a budget with those of K-means++, the mean over clouds."""
    ratios: dict[str, list[float]] = {name: [] for name in MOST_PHI}
    for points in clouds.values():
        plain = quantise(points, CODES, QuantisationSettings(steps=STEPS))
        better = quantise(points, CODES, QuantisationSettings(steps=STEPS, budget_s=BUDGET_S))
        for name, found in ratios.items():
            found.append(getattr(better, name) / getattr(plain, name))
    lines = []
    for name, most in MOST_PHI.items():
        ratio = float(np.mean(ratios[name])) if clouds else None
        title = f"budget of {BUDGET_S} s, {what}, {name}"
        lines.append(Line(title, "-", "K-means++", None, most if what == REAL else None, ratio, True))
    return lines


if __name__ == "__main__":
    run_alone(measure, "Quantisation of depth images beside scikit-learn and faiss.")
