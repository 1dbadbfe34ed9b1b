"""What an episode is made with: versions that its figures may depend on."""

import platform
from importlib.metadata import version

import numba
import numpy as np

PACKAGES = {"bullet": "pybullet"}
"""The package that moves the bodies, by backend."""


def made_with(backend: str) -> dict[str, str]:
    """Return versions of numpy, numba and what moves the bodies, and the kind of processor."""
    package = PACKAGES.get(backend)
    bodies = {} if package is None else {package: version(package)}
    return {"numpy": np.__version__, "numba": numba.__version__, **bodies, "machine": platform.machine()}
