"""What the lines of a CARMEN log say."""

import math
from collections import Counter
from dataclasses import dataclass, field

from lidarium.mapping.files.mending.beam_directions import Beams, stated_beams

_QUIET = ("#", "NEFF", "PARAM", "SYNC", "MARKER", "RLASER", "REMISSION", "TRUEPOS")
"""Messages that hold nothing that is needed here."""


@dataclass(slots=True, eq=False)
class Scan:
    """A line with a scan; without beams where the line has no angles."""

    ranges: list[float]
    stamp: float
    robot_pose: list[float]
    laser_pose: list[float]
    beams: Beams | None
    max_range: float
    has_angles: bool = True


@dataclass(slots=True, eq=False)
class Content:
    """What the lines of a log say.

    A scan comes with the number of ODOM lines before it.
    """

    scans: list[tuple[Scan, int]] = field(default_factory=list)
    odometry: list[tuple[list[float], float]] = field(default_factory=list)
    parameters: dict[str, str] = field(default_factory=dict)
    is_corrected: bool = False
    skipped: Counter[str] = field(default_factory=Counter)
    remarks: Counter[str] = field(default_factory=Counter)


def read_line(line: str, content: Content) -> None:
    """Add what a line says to the content; a damaged line is counted."""
    words = line.split()
    if not words or words[0].startswith("#"):
        return
    try:
        match words[0]:
            case "FLASER":
                content.scans.append((_flaser(words), len(content.odometry)))
            case "ROBOTLASER1":
                content.scans.append((_robotlaser(words), len(content.odometry)))
            case "ODOM":
                content.odometry.append(
                    (_numbers(words[1:4], 3), float(words[9] if len(words) > 9 else words[-1]))
                )
            case "PARAM" if len(words) > 2:
                content.parameters[words[1]] = words[2]
            case "NEFF":
                content.is_corrected = True
            case kind if kind not in _QUIET:
                content.skipped[f"{kind[:30]} lines"] += 1
    except (ValueError, IndexError, OverflowError):
        content.skipped[f"damaged {words[0]} lines"] += 1


def _numbers(words: list[str], count: int) -> list[float]:
    values = list(map(float, words))
    if len(values) != count or not all(map(math.isfinite, values)):
        raise ValueError(f"{words} are not {count} numbers")
    return values


def _flaser(words: list[str]) -> Scan:
    """Read a ``FLASER`` line, of which old logs lack the last two values.

    It is ``FLASER n ranges laser_pose robot_pose stamp host logger_stamp``.
    """
    beams = int(words[1])
    ranges, tail = list(map(float, words[2 : 2 + beams])), words[2 + beams :]
    if beams < 1 or len(ranges) != beams:
        raise ValueError("too few ranges")
    laser_pose, robot_pose = _numbers(tail[:3], 3), _numbers(tail[3:6], 3)
    return Scan(ranges, float(tail[6]), robot_pose, laser_pose, None, math.nan, has_angles=False)


def _robotlaser(words: list[str]) -> Scan:
    """Read the values of a robot-laser message.

    They are type, start, field of view, step, longest range, accuracy, mode, n, ranges, m, remissions,
    laser, robot, and what follows.

    These are five numbers on the drive, the stamp, the host and the logger's stamp.
    """
    start, view, step, max_range = _numbers(words[2:6], 4)
    beams = int(words[8])
    ranges = list(map(float, words[9 : 9 + beams]))
    remissions = int(words[9 + beams])
    tail = words[10 + beams + remissions :]
    if beams < 1 or len(ranges) != beams:
        raise ValueError("too few ranges")
    directions = stated_beams(start, view, step, beams)
    laser_pose, robot_pose = _numbers(tail[:3], 3), _numbers(tail[3:6], 3)
    return Scan(ranges, float(tail[11]), robot_pose, laser_pose, directions, max_range)


def parameter(content: Content, name: str) -> float | None:
    """Return a parameter of the log; None where it has none, or no number."""
    try:
        value = float(content.parameters[name])
    except (KeyError, ValueError):
        return None
    return value if math.isfinite(value) else None
