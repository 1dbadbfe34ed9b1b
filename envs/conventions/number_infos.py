"""Infos as numbers alone, under the same names at each step."""

from collections.abc import Mapping
from enum import Enum
from numbers import Real
from typing import Any

import numpy as np

from lidarium.envs.outcome.endings import REASONS

ENDED = "ended"
"""Why a robot ended, by number in ``endings.REASONS``; 0 where it has not.

A policy's own words have the number after the last one.
"""


def ending_number(reason: str | None) -> int:
    """Return the number of a reason."""
    if reason is None:
        return 0
    return REASONS.index(reason) if reason in REASONS else len(REASONS)


def flat_infos(infos: Mapping[str, Any]) -> dict[str, Any]:
    """Return the numbers among an agent's infos, with names joined by a point.

    ``{"truth": {"pose": (x, y, theta)}}`` becomes ``{"truth.pose.0": x, ...}``. Words, lists, and what is
    there at some steps only are left out; ``ended`` says why a robot has ended.
    """
    return {**_numbers(infos, ""), ENDED: float(ending_number(infos.get("ended_because")))}


def _numbers(values: Mapping[str, Any], prefix: str) -> dict[str, float]:
    found: dict[str, float] = {}
    for name, value in values.items():
        if isinstance(value, Mapping):
            found.update(_numbers(value, f"{prefix}{name}."))
        elif isinstance(value, np.ndarray) and value.dtype.kind in "biuf":
            found.update({f"{prefix}{name}.{k}": float(one) for k, one in enumerate(value.ravel())})
        elif isinstance(value, Real | np.number | np.bool_) and not isinstance(value, Enum):
            found[f"{prefix}{name}"] = float(value)
    return found


def flat_row_infos(infos: Mapping[str, Any], rows: int) -> dict[str, Any]:
    """Return the numbers among the infos of a batch, under the names of `flat_infos`, (rows,) float32 each.

    Each has its mask beside it, as in Gymnasium's vector environments; all rows have all.
    """
    found = _rows(infos, "")
    reasons = infos.get("ended_because")
    found[ENDED] = np.array(
        [0.0] * rows if reasons is None else [float(ending_number(reason)) for reason in reasons]
    )
    everyone = np.ones(rows, np.bool_)
    return {**found, **{f"_{name}": everyone for name in found}}


def _rows(values: Mapping[str, Any], prefix: str) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for name, value in values.items():
        if name.startswith("_"):
            continue
        if isinstance(value, Mapping):
            found.update(_rows(value, f"{prefix}{name}."))
        elif value.dtype.kind in "biuf" and value.ndim == 1:
            found[f"{prefix}{name}"] = value.astype(np.float64)
        elif value.dtype.kind in "biuf":
            flat = value.reshape(len(value), -1).astype(np.float64)
            found.update({f"{prefix}{name}.{k}": flat[:, k] for k in range(flat.shape[1])})
    return found
