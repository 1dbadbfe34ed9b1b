"""Spline maps as files: JSON to read, and a compact binary.

The compact form keeps points as whole multiples of a unit (a millimetre, more for maps beyond 65 m) from the
map's corner in 16 bits, knots as shares of a curve's length in 16 bits, and weights in 8 bits. Of a straight
curve only the ends are kept.
"""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.files.guarded_reading import check_file, read_arrays, read_text, reading
from lidarium.mapping.files.output import write_arrays, write_whole
from lidarium.mapping.geometry.bounds import Rule, shown, within
from lidarium.mapping.splines.bspline import ORDER, Spline
from lidarium.mapping.splines.curve import make_curve
from lidarium.mapping.splines.landmarks import Landmarks
from lidarium.mapping.splines.settings import SplineSettings
from lidarium.mapping.splines.spline_map import SplineMap

VERSION = 1
SEEN = Rule(float, bounds=within(0.0, 2.0**53))
"""How often something may have been seen."""

MAX_LENGTH_M = 10_000.0
"""Longest curve of a map [m]."""

MAX_COORDINATE_M = 1e6
"""Farthest that a curve may lie from the origin [m]."""

MAX_JSON_BYTES = 64 << 20
UNIT = 0.001
_STEPS = 65535
_WEIGHT_STEP = 0.25


def write_spline_map(path: Path, spline_map: SplineMap) -> None:
    """Write a map as JSON or in compact form, whole or not at all.

    JSON if the name ends in ``.json``, compact if it ends in ``.npz``.
    """
    if path.suffix == ".json":
        write_whole(path, (json.dumps(_as_json(spline_map), indent=1) + "\n").encode())
    elif path.suffix == ".npz":
        write_arrays(path, compact_arrays(spline_map), is_compressed=False)
    else:
        raise ValueError(f"{path} is no name for a spline map; want one that ends in .json or .npz")


def read_spline_map(path: Path, settings: SplineSettings | None = None) -> SplineMap:
    """Read a map that `write_spline_map` wrote."""
    check_file(path)
    with reading(path, "a spline map"):
        if path.suffix == ".json":
            return _from_json(json.loads(read_text(path, MAX_JSON_BYTES)), settings)
        arrays = read_arrays(path, "a spline map")
        if not isinstance(arrays, dict):
            raise ValueError("it is a single array")
        return _from_compact_arrays(arrays, settings)


def compact_arrays(spline_map: SplineMap) -> dict[str, NDArray[Any]]:
    """Return the compact form: all that `_from_compact_arrays` needs."""
    controls = [_kept_points(curve.spline) for curve in spline_map.curves]
    points = np.concatenate([np.empty((0, 2)), *controls, spline_map.corners.points, spline_map.peaks.points])
    low = points.min(axis=0) if len(points) else np.zeros(2)
    extent = float(np.ptp(points, axis=0).max()) if len(points) else 0.0
    unit = max(UNIT, extent / _STEPS)
    weights = np.concatenate(
        [
            np.empty(0),
            *(curve.weights for curve in spline_map.curves),
            spline_map.corners.weights,
            spline_map.peaks.weights,
        ]
    )
    counts = [[min(curve.count, _STEPS), min(curve.last_seen, _STEPS)] for curve in spline_map.curves]
    marks = np.concatenate([spline_map.corners.counts, spline_map.peaks.counts])
    return {
        "frame": np.array([VERSION, low[0], low[1], unit, len(spline_map.corners), spline_map.updates]),
        "sizes": np.array([len(control) for control in controls], np.uint16),
        "points": np.rint((points - low) / unit).astype(np.uint16),
        "inner_knots": np.concatenate(
            [np.empty(0, np.uint16), *(_knots_to_shares(curve.spline) for curve in spline_map.curves)]
        ),
        "weights": np.clip(np.rint(weights / _WEIGHT_STEP), 1, 255).astype(np.uint8),
        "counts": np.array(counts, np.uint16).reshape(-1, 2),
        "landmark_counts": np.minimum(marks, _STEPS).astype(np.uint16),
    }


def compact_bytes(spline_map: SplineMap) -> int:
    """Return how many bytes the arrays of the compact form have in all."""
    return sum(array.nbytes for array in compact_arrays(spline_map).values())


def _from_compact_arrays(arrays: dict[str, NDArray[Any]], settings: SplineSettings | None = None) -> SplineMap:
    """Return the map of a compact form."""
    version, x, y, unit, corner_count, updates = arrays["frame"].tolist()
    if version != VERSION:
        raise ValueError(f"version is {version:g}; want {VERSION}")
    spline_map = SplineMap(settings)
    points = np.array([x, y]) + arrays["points"].astype(np.float64) * unit
    weights = arrays["weights"].astype(np.float64) * _WEIGHT_STEP
    point, knot, weight = 0, 0, 0
    for size, (count, last_seen) in zip(arrays["sizes"].tolist(), arrays["counts"].tolist(), strict=True):
        controls = max(size, ORDER)
        shares = arrays["inner_knots"][knot : knot + controls - ORDER].astype(np.float64) / _STEPS
        spline = _checked(_restored(points[point : point + size], shares))
        curve_weights = weights[weight : weight + controls]
        spline_map.curves.append(
            make_curve(spline, curve_weights, count, last_seen, spline_map.settings.map.sample_spacing)
        )
        point, knot, weight = point + size, knot + controls - ORDER, weight + controls
    marks, mark_weights, counts = points[point:], weights[weight:], arrays["landmark_counts"].astype(np.int64)
    if not len(marks) == len(mark_weights) == len(counts):
        raise ValueError("its arrays do not fit together")
    split = int(corner_count)
    spline_map.updates = _counted(updates)
    # When landmarks were last seen is not kept: those on trial begin again.
    now = np.full(len(marks), spline_map.updates, np.int64)
    spline_map.corners = Landmarks(marks[:split], mark_weights[:split], counts[:split], now[:split])
    spline_map.peaks = Landmarks(marks[split:], mark_weights[split:], counts[split:], now[split:])
    return spline_map


def _kept_points(spline: Spline) -> NDArray[np.float64]:
    """Return the control points that determine a curve.

    For a straight curve, the first and the last.
    """
    points = spline.control_points
    if len(points) == ORDER:
        evenly = points[0] + np.linspace(0.0, 1.0, ORDER)[:, None] * (points[-1] - points[0])
        if float(np.abs(points - evenly).max()) < UNIT / 2.0:
            return points[[0, -1]]
    return points


def _restored(points: NDArray[np.float64], shares: NDArray[np.float64]) -> Spline:
    """Return the curve of kept control points and inner knots.

    Its knots are along the curve, in metres.
    """
    if len(points) == 2:
        points = points[0] + np.linspace(0.0, 1.0, ORDER)[:, None] * (points[1] - points[0])
    knots = np.concatenate([np.zeros(ORDER), shares, np.ones(ORDER)])
    spline = Spline(knots, points)
    return Spline(knots * spline.length(), points)


def _counted(value: Any) -> int:  # noqa: ANN401
    """Return how often, or when, something was seen."""
    if not SEEN.hold(value):
        raise ValueError(f"it has {shown(value)} updates; want {SEEN.wanted}")
    return int(value)


def _checked(spline: Spline) -> Spline:
    """Return a curve that is no longer than walls are."""
    first, last = spline.domain
    farthest = float(np.abs(spline.control_points).max())
    if not (last - first <= MAX_LENGTH_M and farthest <= MAX_COORDINATE_M):
        raise ValueError(
            f"a curve is {last - first:g} m long, up to {farthest:g} m away; want at most "
            f"{MAX_LENGTH_M:,.0f} m, up to {MAX_COORDINATE_M:,.0f} m"
        )
    return spline


def _knots_to_shares(spline: Spline) -> NDArray[np.uint16]:
    inner = spline.knots[ORDER : len(spline.control_points)]
    return np.rint(inner / spline.domain[1] * _STEPS).astype(np.uint16)


def _as_json(spline_map: SplineMap) -> dict[str, Any]:
    return {
        "version": VERSION,
        "updates": spline_map.updates,
        "curves": [
            {
                "knots": curve.spline.knots.tolist(),
                "control_points": curve.spline.control_points.tolist(),
                "weights": curve.weights.tolist(),
                "count": curve.count,
                "last_seen": curve.last_seen,
            }
            for curve in spline_map.curves
        ],
        **{
            name: {
                "points": marks.points.tolist(),
                "weights": marks.weights.tolist(),
                "counts": marks.counts.tolist(),
                "last_seen": marks.last_seen.tolist(),
            }
            for name, marks in (("corners", spline_map.corners), ("peaks", spline_map.peaks))
        },
    }


def _from_json(content: dict[str, Any], settings: SplineSettings | None) -> SplineMap:
    if content["version"] != VERSION:
        raise ValueError(f"version is {content['version']}; want {VERSION}")
    spline_map = SplineMap(settings)
    for curve in content["curves"]:
        spline = _checked(Spline(np.array(curve["knots"], np.float64), np.array(curve["control_points"], np.float64)))
        weights = np.array(curve["weights"], np.float64)
        spacing = spline_map.settings.map.sample_spacing
        spline_map.curves.append(
            make_curve(spline, weights, _counted(curve["count"]), _counted(curve["last_seen"]), spacing)
        )
    for name in ("corners", "peaks"):
        marks = content[name]
        points, weights = (
            np.array(marks["points"], np.float64).reshape(-1, 2),
            np.array(marks["weights"], np.float64),
        )
        counts, last_seen = np.array(marks["counts"], np.int64), np.array(marks["last_seen"], np.int64)
        if not len(points) == len(weights) == len(counts) == len(last_seen):
            raise ValueError(f"its {name} have not as many points as weights, counts and times")
        if not (np.isfinite(points).all() and np.isfinite(weights).all() and (weights >= 0.0).all()):
            raise ValueError(f"its {name} have points or weights that are not finite, or weights below 0")
        setattr(spline_map, name, Landmarks(points, weights, counts, last_seen))
    spline_map.updates = _counted(content["updates"])
    if not all(0.0 <= value < math.inf for curve in spline_map.curves for value in curve.weights.tolist()):
        raise ValueError("weights of curves are not finite, or below 0")
    return spline_map
