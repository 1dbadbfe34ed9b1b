"""IR-SIM as a peer: one robot with a lidar2d.

It is on a floor of rectangles or on its grid map.
"""

import contextlib
import importlib
import importlib.util
import io
import math
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import yaml
from numpy.typing import NDArray

from lidarium.benchmarks.speed.scenes.floors import BenchFloor


def fastest_irsim_step(
    floor: BenchFloor, poses: NDArray[np.float64], shape: str, beams: int, reach: float
) -> Callable[[], object] | None:
    """Return a function that steps IR-SIM with one robot.

    The robot is at the pose where IR-SIM is fastest; None where it is not installed.

    Its time depends on what is in the robot's reach, several times over on a grid map.

    Parameters
    ----------
    floor : BenchFloor
        The floor.
    poses : (trials, 3) float64
        Where the robot may start [m, rad].
    shape : str
        ``rectangles`` or ``grid map``.
    beams : int
        Beams of the lidar.
    reach : float
        Its longest range [m].
    """
    if importlib.util.find_spec("irsim") is None:
        return None
    # IR-SIM asks matplotlib for a window while it is imported, and tells on standard output that there is
    # none.
    with contextlib.redirect_stdout(io.StringIO()):
        irsim = importlib.import_module("irsim")

    steps = [_step(irsim, floor, pose, shape, beams, reach) for pose in poses]
    return min(steps, key=_seconds)


def _step(
    irsim: Any,  # noqa: ANN401
    floor: BenchFloor,
    pose: NDArray[np.float64],
    shape: str,
    beams: int,
    reach: float,
) -> Callable[[], object]:
    with tempfile.TemporaryDirectory() as folder:
        env = irsim.make(
            str(_write_world(Path(folder), floor, pose, shape, beams, reach)),
            headless=True,
            log_level="ERROR",
        )
    action = np.array([[0.2], [0.3]])
    count = 0

    def step() -> None:
        nonlocal count
        count += 1
        # To and fro, so that the robot stays clear of the walls, at which IR-SIM would stop it for good.
        env.step([action if count // 10 % 2 else -action], [0])

    return step


def _seconds(step: Callable[[], object]) -> float:
    step()
    began = time.perf_counter()
    step()
    return time.perf_counter() - began


def _write_world(
    folder: Path, floor: BenchFloor, pose: NDArray[np.float64], shape: str, beams: int, reach: float
) -> Path:
    rows, columns = floor.solid.shape
    world = {
        "height": rows * floor.resolution,
        "width": columns * floor.resolution,
        "step_time": 0.1,
        "sample_time": 0.1,
        "collision_mode": "stop",
    }
    lidar = {
        "name": "lidar2d",
        "range_min": 0.02,
        "range_max": reach,
        "angle_range": math.radians(240.0),
        "number": beams,
        "noise": True,
        "std": 0.01,
    }
    robot = {
        "kinematics": {"name": "diff"},
        "shape": {"name": "circle", "radius": 0.18},
        "state": [float(value) for value in pose],
        "goal": [float(pose[0]) + 5.0, float(pose[1]), 0.0],
        "sensors": [lidar],
    }
    content: dict[str, object] = {"world": world, "robot": [robot]}
    if shape == "grid map":
        image = folder / "floor.png"
        cv2.imwrite(str(image), (255 * (1 - floor.solid[::-1])).astype(np.uint8))
        world |= {"obstacle_map": str(image), "mdownsample": 1}
    else:
        content["obstacle"] = [
            {
                "shape": {
                    "name": "rectangle",
                    "length": float(x_high - x_low),
                    "width": float(y_high - y_low),
                },
                "state": [float(x_low + x_high) / 2, float(y_low + y_high) / 2, 0.0],
            }
            for x_low, y_low, x_high, y_high in floor.boxes
        ]
    path = folder / "world.yaml"
    path.write_text(yaml.safe_dump(content), encoding="utf-8")
    return path
