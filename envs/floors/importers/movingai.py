"""Grid maps of the MovingAI benchmarks: text with a letter for each cell.

References
----------
N. R. Sturtevant, Benchmarks for grid-based pathfinding, IEEE Transactions on Computational Intelligence and
AI in Games, 2012.
"""

from pathlib import Path

import numpy as np

from lidarium.envs.floors.floor import Floor
from lidarium.envs.floors.importers.common import floor_of_cells, read_text

FREE, SOLID = ".GS", "@OTW"
"""Letters of cells: ground and swamp can be driven on; out of bounds, trees and water cannot."""

_MAX_SIDE = 1 << 16


def matches(path: Path) -> bool:
    """Return whether a file begins as a grid map does."""
    return read_text(path).lstrip().lower().startswith("type")


def has_scale(path: Path) -> bool:
    """Return False: the file does not state its scale."""
    return False


def load(path: Path, resolution: float | None) -> Floor:
    """Read a grid map whose cells have a side of ``resolution`` [m]; the first line is at the top."""
    if resolution is None:
        raise ValueError(f"{path} does not say how large a cell is; want image_resolution (--resolution), such as 0.5")
    lines = [line.rstrip("\r\n") for line in read_text(path).strip().split("\n")]
    try:
        begin = [line.strip().lower() for line in lines[:16]].index("map")
    except ValueError:
        raise ValueError(f"{path} has no line 'map'; want type, height, width and map before the cells") from None
    rows, columns = (_side(path, lines[:begin], name) for name in ("height", "width"))
    cells = lines[begin + 1 : begin + 1 + rows]
    if len(cells) < rows:
        raise ValueError(f"{path} has {len(cells)} lines of cells; its height is {rows}")
    for number, line in enumerate(cells, begin + 2):
        if len(line) != columns:
            raise ValueError(f"{path}, line {number} has {len(line)} cells; the width is {columns}")
        if strange := set(line) - set(FREE + SOLID):
            raise ValueError(f"{path}, line {number} has a cell {min(strange)!r}; want one of {' '.join(FREE + SOLID)}")
    letters = np.array([list(line) for line in cells])
    free = np.isin(letters, list(FREE))
    return floor_of_cells(path, free[::-1], (0.0, 0.0), resolution)


def _side(path: Path, lines: list[str], name: str) -> int:
    words = next((line.split() for line in lines if line.lower().startswith(name)), [])
    number = words[1] if len(words) == 2 and words[1].isascii() and words[1].isdigit() else ""
    if not number or len(number) > 6 or not 0 < int(number) <= _MAX_SIDE:
        raise ValueError(f"{path} has no good {name}; want a line '{name} N' with N from 1 to {_MAX_SIDE}")
    return int(number)
