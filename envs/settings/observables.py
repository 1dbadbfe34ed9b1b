"""Observations in addition to those of the kernels.

An entry of the registry ``observable`` is a function of named arrays, or has the name of an array of
``Simulation.sensors`` and is observed as that array has it, row by row.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from lidarium.registry import Registry


@dataclass(frozen=True, slots=True)
class Observable:
    """Something that can be observed.

    Attributes
    ----------
    box : callable
        The space of one robot's observation, from the settings; bounded.
    missing : callable
        Returns the missing requirement of the settings, in words; empty if nothing is missing.
    compute : callable or None
        Takes ``Rows``, named arrays over the robots of all episodes, and returns the values of all, (rows,
        ...); it keeps nothing from call to call. None for the array of sensors of this name.
    """

    box: Callable[[Any], spaces.Box]
    missing: Callable[[Any], str] = lambda settings: ""
    compute: Callable[[Any], NDArray[Any]] | None = None


SENSED: Registry[Observable] = Registry("observable")
"""Observations by name: sensors have that of their array."""


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


_OF_THE_TEAM = "lidarium.envs.observing.observables"

SENSED.register("time_left", f"{_OF_THE_TEAM}:TIME_LEFT", "share of the horizon that is left, (1,)")
SENSED.register("coverage", f"{_OF_THE_TEAM}:COVERAGE", "true share of F that the team has seen, (1,)")
SENSED.register(
    "teammates",
    f"{_OF_THE_TEAM}:TEAMMATES",
    "place, heading, goal, age of what is known of each of the others, (robots - 1, 8)",
)


SENSED.register(
    "pyramid",
    "lidarium.envs.observing.map_pyramid:PYRAMID",
    "the whole known map around the robot in pictures that show more and more, (levels, P, P)",
)

SENSED.register(
    "predicted_map",
    "lidarium.envs.observing.predicted_map:PREDICTED_MAP",
    "probability that squares of 0.2 m within 16 m of the robot are free, (160, 160)",
)


def check_sensed(settings: Any) -> None:  # noqa: ANN401
    """Check that the sensors which are observed are there."""
    for name in settings.observe:
        missing = SENSED[name].missing(settings) if name in SENSED else ""
        if missing:
            raise ValueError(f"observe has {name!r}, which needs {missing}")
