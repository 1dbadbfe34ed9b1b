"""How much of a floor is explored.

F are the free cells that count: those that the disc of the smallest robot sweeps over its configuration
space, connected to the starts. S are the truth's occupied cells around them.

References
----------
C_free: Chen et al., Self-learning exploration and mapping (2019), and ARiADNE (Cao et al., ICRA 2023).
C_known: Xu et al., Explore-Bench (ICRA 2022). C_valid: Ho et al., MapEx (ICRA 2025). C_own: IR2 (Tan et al.,
IROS 2024).
"""

import numpy as np
from numpy.typing import NDArray

from lidarium.evaluation.metrics.maps import surface
from lidarium.evaluation.metrics.shares import Mask, share


def free_coverage(sensed: Mask, counted: Mask) -> float:
    """Return ``C_free`` = |sensed and F| / |F|, the share of F that was sensed.

    It is 1 where F is empty.

    Parameters
    ----------
    sensed : (rows, columns) bool
        Cells that were sensed.
    counted : (rows, columns) bool
        F.
    """
    return share(sensed & counted, counted)


def own_coverage(sensed: NDArray[np.bool_], counted: Mask) -> tuple[float, float]:
    """Return the least and the mean ``C_own,i`` over the robots (IR2).

    ``C_own,i`` = |known free by robot i and F| / |F|.

    Parameters
    ----------
    sensed : (robots, rows, columns) bool
        Cells that each robot knows to be free.
    counted : (rows, columns) bool
        F.
    """
    shares = [free_coverage(own, counted) for own in sensed]
    return min(shares), float(np.mean(shares))


def known_coverage(known: Mask, knowable: Mask) -> float:
    """Return ``C_known`` = |known and knowable| / |knowable|.

    Walls count as well (Explore-Bench).

    Explore-Bench's script divides all known cells by the area of the true map that is not unknown, so that
    cells known beyond that area count and the share can pass 1; here they do not count.

    Parameters
    ----------
    known : (rows, columns) bool
        Cells of the map that are not unknown.
    knowable : (rows, columns) bool
        Cells of the true map that are not unknown.
    """
    return share(known & knowable, knowable)


def valid_coverage(known: Mask, counted: Mask, occupied: Mask) -> float:
    """Return ``C_valid`` = |known and (F or S)| / |F or S| (MapEx).

    S lies around all of F.

    Parameters
    ----------
    known, counted, occupied : (rows, columns) bool
        Cells that are not unknown, F, and the truth's occupied cells.
    """
    valid = counted | surface(occupied, counted)
    return share(known & valid, valid)
