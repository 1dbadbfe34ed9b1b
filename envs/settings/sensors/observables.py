"""What robots can observe of sensors that are no part of the kernels' observations.

An entry of the registry ``observable`` has the name of an array of ``Simulation.sensors``. It is observed as
that array has it, row by row.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from gymnasium import spaces

from lidarium.registry import Registry


@dataclass(frozen=True, slots=True)
class Observable:
    """A sensor that can be observed.

    Attributes
    ----------
    box : callable
        The space of one robot's observation, from the settings.
    missing : callable
        What the settings lack for it, in words; empty where nothing.
    """

    box: Callable[[Any], spaces.Box]
    missing: Callable[[Any], str] = lambda settings: ""


SENSED: Registry[Observable] = Registry("observable")
"""Sensors that can be observed, by the name of their array."""


def _depth_box(settings: Any) -> spaces.Box:  # noqa: ANN401
    camera = settings.camera
    return spaces.Box(0.0, np.float32(camera.depth_max), (1, camera.rows, camera.columns), np.float32)


def _missing_camera(settings: Any) -> str:  # noqa: ANN401
    return "" if settings.camera is not None else "a camera: set camera, such as camera='xtion'"


SENSED.register(
    "depth",
    Observable(_depth_box, _missing_camera),
    "last image of the depth camera [m]; 0 for no measurement",
)


def check_sensed(settings: Any) -> None:  # noqa: ANN401
    """Check that the sensors which are observed are there.

    Raises
    ------
    ValueError
        Where one is not; the message says what is missing.
    """
    for name in settings.observe:
        missing = SENSED[name].missing(settings) if name in SENSED else ""
        if missing:
            raise ValueError(f"observe has {name!r}, which needs {missing}")
