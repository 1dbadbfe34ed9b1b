"""Vector maps of the AMRL group: wall lines in metres.

Each line of text is one wall line ``x1, y1, x2, y2``.
"""

from pathlib import Path

import numpy as np

from lidarium.envs.floors.floor import Floor
from lidarium.envs.floors.importers.common import floor_of_lines, is_number, read_text, refuse_resolution


def matches(path: Path) -> bool:
    """Return whether a file is an AMRL vector map.

    The format is recognised by the file's name, or by four numbers with commas in the first line of text.
    """
    if ".vectormap." in path.name.lower():
        return True
    first = read_text(path).lstrip().split("\n", 1)[0].split(",")
    return len(first) == 4 and all(is_number(word) for word in first)


def load(path: Path, resolution: float | None) -> Floor:
    """Read a vector map; outside of the outer walls is solid.

    Door leaves drawn as lines are walls.
    """
    refuse_resolution(path, resolution)
    lines = []
    for number, line in enumerate(read_text(path).splitlines(), start=1):
        words = line.split(",")
        if not line.strip():
            continue
        if len(words) != 4 or not all(is_number(word) for word in words):
            raise ValueError(f"{path}, line {number}: {line[:60]!r} is no wall; want x1, y1, x2, y2 in metres")
        lines.append([float(word) for word in words])
    if not lines:
        raise ValueError(f"{path} has no lines; want x1, y1, x2, y2 per wall in metres")
    return floor_of_lines(path, np.array(lines), np.zeros((0, 4)))
