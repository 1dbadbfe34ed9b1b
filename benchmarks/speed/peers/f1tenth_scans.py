"""f1tenth's scan simulator as a peer.

It is an outside module, loaded from where the user has put it.

It is not on PyPI. LIDARIUM_F1TENTH names its file, ``gym/f110_gym/envs/laser_models.py`` of the repository
f1tenth/f1tenth_gym.
"""

import importlib.util
import math
import os
import sys
import tempfile
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from lidarium.benchmarks.speed.scenes.floors import BenchFloor

SOURCE = "LIDARIUM_F1TENTH"


def is_there() -> bool:
    """Whether the simulator's file is named."""
    return bool(os.environ.get(SOURCE))


class F1tenthScanner:
    """Casts scans with the original simulator, its noise included."""

    def __init__(self, floor: BenchFloor, beams: int, reach: float) -> None:
        path = Path(os.environ[SOURCE])
        spec = importlib.util.spec_from_file_location(path.stem, path)
        assert spec is not None
        assert spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        # Its compiled functions look their module up by name.
        sys.modules[path.stem] = module
        spec.loader.exec_module(module)
        self._simulator = module.ScanSimulator2D(beams, math.radians(240.0), max_range=reach)
        with tempfile.TemporaryDirectory() as folder:
            image, about = Path(folder) / "floor.png", Path(folder) / "floor.yaml"
            cv2.imwrite(str(image), np.where(floor.solid[::-1] != 0, 0, 255).astype(np.uint8))
            about.write_text(f"resolution: {floor.resolution}\norigin: [0.0, 0.0, 0.0]\n", encoding="utf-8")
            self._simulator.set_map(str(about), ".png")

    def scan(self, pose: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the ranges at a pose x, y, theta [m, rad], shape (beams,) [m]."""
        ranges: NDArray[np.float64] = self._simulator.scan(pose)
        return ranges
