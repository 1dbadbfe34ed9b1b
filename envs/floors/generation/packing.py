"""Floors of solids as a few flat arrays and back, to the bit."""

from collections.abc import Mapping
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.floors.floor import Floor, Solid


def packed_floor(floor: Floor) -> dict[str, NDArray[Any]]:
    """Return a floor as flat arrays.

    Parameters
    ----------
    floor : Floor
        A floor of solids.

    Returns
    -------
    dict of arrays
        ``name`` (UTF-8), ``bounds``, ``heights`` (S, 2), ``rings`` of each solid (S,), ``corners`` of each
        ring (R,), ``points`` of all rings (N, 2), ``starts`` (K, 3), and ``goal``, (2,) or empty.

    Raises
    ------
    ValueError
        If the floor is made of cells.
    """
    if floor.cells is not None:
        raise ValueError(f"floor {floor.name!r} is made of cells; want one of solids")
    rings = [ring for solid in floor.solids for ring in (solid.polygon, *solid.holes)]
    return {
        "name": np.frombuffer(floor.name.encode(), np.uint8),
        "bounds": np.array(floor.bounds, np.float64),
        "heights": np.array([(solid.z_low, solid.z_high) for solid in floor.solids], np.float64).reshape(
            -1, 2
        ),
        "rings": np.array([1 + len(solid.holes) for solid in floor.solids], np.int64),
        "corners": np.array([len(ring) for ring in rings], np.int64),
        "points": np.concatenate([np.zeros((0, 2)), *rings]),
        "starts": floor.starts,
        "goal": np.array(floor.goal or (), np.float64),
    }


def unpacked_floor(arrays: Mapping[str, NDArray[Any]]) -> Floor:
    """Return the floor that `packed_floor` packed; its solids are views of the arrays."""
    ends = [0, *np.cumsum(arrays["corners"]).tolist()]
    rings = iter([arrays["points"][first:last] for first, last in pairwise(ends)])
    solids = tuple(
        Solid(next(rings), z_low, z_high, tuple(next(rings) for _ in range(count - 1)))
        for (z_low, z_high), count in zip(arrays["heights"].tolist(), arrays["rings"].tolist(), strict=True)
    )
    x_min, y_min, x_max, y_max = arrays["bounds"].tolist()
    goal = arrays["goal"].tolist()
    return Floor(
        name=arrays["name"].tobytes().decode(),
        bounds=(x_min, y_min, x_max, y_max),
        solids=solids,
        starts=arrays["starts"],
        goal=(goal[0], goal[1]) if goal else None,
    )
