"""The thesis's first experiment: errors and times of three quantisers over the number of codes.

Its clouds are lost or not free; here are frames and heavy clouds of others, and simulated frames.
"""

import time
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.benchmarks.studies.shared.study import Progress, Task, do_missing
from lidarium.benchmarks.studies.sparse.places import CAMERA, frames_of, load_place
from lidarium.mapping.point_clouds.cameras import Intrinsics
from lidarium.mapping.point_clouds.cloud_files import read_cloud
from lidarium.mapping.sparse.quantisation.quantiser import QuantisationSettings, quantise

CODES = range(16, 513, 16)
REPEATS, STEPS = 10, 7
KINECT = Intrinsics(585.0, 585.0, 320.0, 240.0)

CLOUDS = {
    "kitchen": tuple(f"redkitchen/frame-000{number:03d}.depth.png" for number in (0, 200, 400, 600, 800)),
    "office": tuple(f"pcl/tutorials__pairwise__capture000{number}.pcd" for number in range(1, 6)),
    "table tops": (
        "pcl/tutorials__correspondence_grouping__milk_cartoon_all_small_clorox.pcd",
        "pcl/segmentation__mOSD__learn__learn0.pcd",
        "pcl/segmentation__mOSD__learn__learn20.pcd",
        "pcl/segmentation__mOSD__test__test60.pcd",
    ),
    "heavy": (
        "redkitchen/redkitchen_fused_2cm.npz",
        "open3d/fragment.pcd",
        "pcl/tutorials__room_scan1.pcd",
        "pcl/tutorials__room_scan2.pcd",
        "octomap/geb079_west.npz",
        "octomap/scan_outdoor_stairs.npz",
    ),
}
"""Files below the folder ``clouds`` of real data, by kind: frames of depth cameras, and whole places."""

SIMULATED = "simulated"
SIMULATED_FRAMES = 5
QUANTISATION_FILE = "quantisation.jsonl"
METHODS = ("kmeans", "kmeans++", "lbg")


@dataclass(frozen=True, slots=True)
class CloudTask(Task):
    """A cloud: its kind, and its file below ``clouds`` or the number of a simulated frame."""

    kind: str
    name: str


def measure(clouds: Path | None, task: CloudTask) -> dict[str, Any]:
    """Quantise a cloud with all methods and numbers of codes; return mean errors and times."""
    points = _points(clouds, task)
    quantise(points, 16, QuantisationSettings(steps=STEPS))  # compiles
    lines: dict[str, list[list[float]]] = {}
    for method in METHODS:
        lines[method] = []
        for codes in CODES:
            if method == "lbg" and codes & (codes - 1):
                continue
            lines[method].append([float(codes), *_mean_figures(points, codes, method)])
    return {"kind": task.kind, "name": task.name, "points": len(points), "figures": lines}


def _mean_figures(points: NDArray[np.float32], codes: int, method: str) -> tuple[float, float, float]:
    """Return mean distance [m], mean squared distance [m2] and median time [s] over seeds."""
    errors, squares, seconds = [], [], []
    # LBG draws nothing: it gives the same bits each time.
    for seed in range(1 if method == "lbg" else REPEATS):
        settings = QuantisationSettings(method, steps=STEPS, seed=seed)
        began = time.perf_counter()
        found = quantise(points, codes, settings)
        seconds.append(time.perf_counter() - began)
        errors.append(found.phi1)
        squares.append(found.phi2)
    return float(np.mean(errors)), float(np.mean(squares)), float(np.median(seconds))


def _points(clouds: Path | None, task: CloudTask) -> NDArray[np.float32]:
    if task.kind == SIMULATED:
        place = load_place("apartment")
        camera = replace(CAMERA, columns=640, rows=480, depth_max=50.0)
        step = SIMULATED_STEP * int(task.name)
        for number, frame in enumerate(frames_of(place, camera=camera)):
            if number == step:
                return frame.points.astype(np.float32)
    assert clouds is not None
    path = clouds / task.name
    if path.suffix == ".npz":
        with np.load(path) as arrays:
            name = next(name for name in ("xyz", "occupied", "points") if name in arrays)
            return np.asarray(arrays[name][:, :3], np.float32)
    intrinsics = KINECT if path.name.endswith(".depth.png") else None
    found = read_cloud(path, None, intrinsics).points
    return np.asarray(found[np.isfinite(found).all(axis=1)], np.float32)


SIMULATED_STEP = 211
"""Between the frames of a survey that are quantised: they look into all directions."""


def work(folder: Path, data: Path | None, every: int) -> Progress:
    """Quantise every N-th cloud, simulated ones alone without data; timed, so one after the other."""
    clouds = None if data is None else Path(data) / "clouds"
    tasks = [CloudTask(SIMULATED, str(number)) for number in range(SIMULATED_FRAMES)]
    if clouds is not None:
        tasks += [CloudTask(kind, name) for kind, names in CLOUDS.items() for name in names]
    yield from do_missing(folder / QUANTISATION_FILE, "clouds", tasks[::every], partial(measure, clouds), 1)
