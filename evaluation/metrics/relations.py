"""Agreement of a trajectory with known motions between pairs of times.

References
----------
Kuemmerle et al., On measuring the accuracy of SLAM algorithms (Autonomous Robots 27, 2009), and their files
of relations.
"""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.files.laser_logs import LaserLog
from lidarium.mapping.files.trajectories import at_readings, interpolated, last_before, read_numbers
from lidarium.mapping.geometry.rigid import relative

Which = Literal["between", "before"]

BEYOND_S = 1.0
"""Bound of the times of relations beyond a log [s].

Stamps are rounded, and not always those of scans.
"""


@dataclass(frozen=True, slots=True, eq=False)
class Relations:
    """Motions that are known.

    Attributes
    ----------
    begin, end : (relations,) float64
        From when to when [s]; an end may be before its begin.
    motions : (relations, 3) float64
        Pose at the end as seen from that at the begin: x, y, theta [m, rad].
    """

    begin: NDArray[np.float64]
    end: NDArray[np.float64]
    motions: NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class RelationErrors:
    """Errors of a trajectory against known relations.

    Attributes
    ----------
    relations : int
        Number of relations.
    translation_m, translation_sd_m : float
        Mean length of the difference and its standard deviation [m].
    rotation_rad, rotation_sd_rad : float
        Mean angle of the difference and its standard deviation [rad].
    translation_squared_m2, translation_squared_sd_m2, rotation_squared_rad2, rotation_squared_sd_rad2 : float
        The same of their squares [m^2, rad^2].
    """

    relations: int
    translation_m: float
    translation_sd_m: float
    rotation_rad: float
    rotation_sd_rad: float
    translation_squared_m2: float
    translation_squared_sd_m2: float
    rotation_squared_rad2: float
    rotation_squared_sd_rad2: float

    def as_dict(self) -> dict[str, float]:
        """Return all numbers by name."""
        return asdict(self)


def read_relations(path: Path) -> Relations:
    """Read ``t1 t2 dx dy dz roll pitch yaw`` a line, plain or gzipped.

    Motion out of the plane is ignored.
    """
    table = read_numbers(path, 8, "a file of relations (t1 t2 dx dy dz roll pitch yaw)")
    return Relations(table[:, 0].copy(), table[:, 1].copy(), table[:, [2, 3, 7]])


def covered(relations: Relations, stamps: NDArray[np.float64]) -> Relations:
    """Return the relations of times that a log covers.

    Parameters
    ----------
    stamps : (scans,) float64
        Times of the log's scans, growing, on the clock of the relations [s].
    """
    first, last = np.minimum(relations.begin, relations.end), np.maximum(relations.begin, relations.end)
    is_inside = (first >= stamps[0] - BEYOND_S) & (last <= stamps[-1] + BEYOND_S)
    if not is_inside.any():
        raise ValueError(
            f"the relations are of {first.min():.3f} to {last.max():.3f} s, the log of {stamps[0]:.3f} to "
            f"{stamps[-1]:.3f} s; "
            "want what they have in common: shift the log's clock"
        )
    return Relations(relations.begin[is_inside], relations.end[is_inside], relations.motions[is_inside])


def relation_errors(begin: NDArray[np.float64], end: NDArray[np.float64], relations: Relations) -> RelationErrors:
    """Return the errors of poses against relations.

    An error is the motion between a relation's two poses, as seen from the true one.

    Parameters
    ----------
    begin, end : (relations, 3) float64
        Poses at the relations' times: x, y, theta [m, rad].
    """
    difference = relative(relations.motions, relative(begin, end))
    translation, rotation = np.hypot(difference[:, 0], difference[:, 1]), np.abs(difference[:, 2])
    values = [function(errors) for errors in (translation, rotation) for function in (np.mean, np.std)]
    squares = [function(errors**2) for errors in (translation, rotation) for function in (np.mean, np.std)]
    return RelationErrors(len(difference), *(float(value) for value in (*values, *squares)))


def log_relation_errors(
    log: LaserLog,
    poses: NDArray[np.float64],
    relations: Relations,
    clock_shift: float = 0.0,
    which: Which = "between",
) -> RelationErrors:
    """Return by how much the poses found for a log's scans miss relations.

    Those of times beyond the log are left out.

    Parameters
    ----------
    poses : (scans, 3) float64
        The robot's poses at its scans [m, rad].
    """
    stamps = log.stamps + clock_shift
    relations = covered(relations, stamps)
    if which == "between":
        return relation_errors(
            interpolated(stamps, poses, relations.begin),
            interpolated(stamps, poses, relations.end),
            relations,
        )
    if len(log.reading_of_scan):
        poses, stamps = (
            at_readings(poses, log.reading_of_scan, log.readings),
            log.readings_stamps + clock_shift,
        )
    return relation_errors(
        last_before(stamps, poses, relations.begin), last_before(stamps, poses, relations.end), relations
    )
