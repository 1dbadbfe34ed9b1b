"""The scans of a CARMEN log in the directions of most of them."""

import math
from collections import Counter
from functools import cache

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.files.carmen.lines import Content, Scan, parameter
from lidarium.mapping.files.mending.beam_directions import (
    Beams,
    FieldOfView,
    from_right_to_left,
    resampled,
)

SICK_MAX_M = 80.0
"""What a SICK LMS gives from here on is no range but the absence of one [m]."""


def give_directions(content: Content, field_of_view: float | None) -> None:
    """Give each scan the directions of its beams, from right to left."""
    fov, step = (parameter(content, f"laser_front_laser_{name}") for name in ("fov", "resolution"))
    view = FieldOfView(
        field_of_view,
        None if fov is None or not 0.0 < fov <= 360.0 else math.radians(fov),
        None if step is None else math.radians(step),
    )
    assumed = cache(view.beams)
    for scan, _ in content.scans:
        stated = scan.beams or assumed(len(scan.ranges))
        scan.ranges, beams = from_right_to_left(scan.ranges, stated)
        scan.beams = beams._replace(remark="") if beams.remark else beams
        for remark in {stated.remark, beams.remark} - {""} if stated.remark or beams.remark else ():
            content.remarks[remark] += 1


def on_one_grid(content: Content) -> tuple[list[tuple[Scan, int]], Beams, NDArray[np.float32], float]:
    """Return the scans that are kept, the directions of most, the ranges in these, and the longest one.

    Scans whose own line has other directions are resampled; a scan without any that has fewer beams than most
    is damaged.
    """
    groups = Counter((len(scan.ranges), scan.beams) for scan, _ in content.scans)
    (count, beams), _ = groups.most_common(1)[0]
    assert beams is not None
    kept = [each for each in content.scans if len(each[0].ranges) == count or each[0].has_angles]
    if len(kept) < len(content.scans):
        content.skipped[f"scans that have not {count} beams as most"] = len(content.scans) - len(kept)
    highest = _max_range(kept)
    ranges = np.empty((len(kept), count), np.float32)
    is_other = np.array([(len(scan.ranges), scan.beams) != (count, beams) for scan, _ in kept])
    same = [scan.ranges for (scan, _), other in zip(kept, is_other, strict=True) if not other]
    ranges[~is_other] = _marked(np.array(same, np.float32), highest)
    for place in np.flatnonzero(is_other):
        scan = kept[place][0]
        assert scan.beams is not None
        own = _marked(np.array(scan.ranges, np.float32), highest)
        ranges[place] = resampled(own, scan.beams, beams, count)
    if is_other.any():
        content.remarks[f"scans whose beams are not {count} as of most are resampled"] = int(is_other.sum())
    return kept, beams, ranges, highest


def _marked(ranges: NDArray[np.float32], highest: float) -> NDArray[np.float32]:
    """Mark what is no range: nan where the beam is invalid, inf where nothing returned."""
    ranges[~(ranges > 0.0)] = np.nan
    with np.errstate(invalid="ignore"):
        ranges[ranges >= highest * (1.0 - 1e-6)] = np.inf
    return ranges


def _max_range(scans: list[tuple[Scan, int]]) -> float:
    """Return the range that says that there was no return [m]."""
    first = scans[0][0]
    if math.isfinite(first.max_range) and first.max_range > 0.0:
        return first.max_range
    known = np.array([value for scan, _ in scans for value in scan.ranges], np.float32)
    known = known[np.isfinite(known)]
    highest = float(known.max()) if known.size and known.max() > 0.0 else 1.0
    return min(highest, SICK_MAX_M)
