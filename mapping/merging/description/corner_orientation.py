"""Table of the orientation of a corner by its neighbourhood."""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray


@lru_cache
def orientation_table(rule: str = "table", neighbours: tuple[int, ...] = (4, 5, 6)) -> NDArray[np.uint8]:
    """Return the opening angle of each of the 256 codes plus one, shape (256,).

    Angles are in units of ``STEP``; 0 where the code is no corner.
    """
    table = np.zeros(256, np.uint8)
    for code in range(256):
        opening = _literal_opening(code) if rule == "literal" else _opening(code)
        if opening is not None and code.bit_count() in neighbours:
            table[code] = opening + 1
    table.setflags(write=False)
    return table


def _opening(code: int) -> int | None:
    """Return the direction in which a code opens [STEP], None for no corner.

    None where its free cells are not the single run that a corner has.
    """
    free = [i for i in range(8) if not code >> i & 1]
    if len(free) not in (1, 2, 3, 4):
        return None
    if len(free) == 4:
        # An L without its corner cell: that diagonal is free, and opposite lies a run of three free cells
        # around a diagonal.
        middles = [i for i in free if i % 2 == 1 and {(i - 1) % 8, (i + 1) % 8, (i + 4) % 8} < set(free)]
        return 2 * middles[0] if len(middles) == 1 else None
    starts = [i for i in free if (i - 1) % 8 not in free]
    if len(starts) != 1 or (len(free) == 3 and starts[0] % 2 == 1):
        return None
    return (2 * starts[0] + len(free) - 1) % 16


def _literal_opening(code: int) -> int | None:
    """Return the opening direction of a code by the printed parity rules [STEP].

    The rules are as they were printed, modulus 2.
    """
    a, p, b, q, a_, p_, b_, q_ = (code >> i & 1 for i in range(8))
    r = code.bit_count()
    direct, main, other = a + a_ + b + b_, p + p_, q + q_
    free = [i for i in range(8) if not code >> i & 1]
    if r == 4:
        is_corner = (
            (a + p + b) % 2 == 0 and direct == 2 and (p + b + q) + (p_ + b_ + q_) == 3 and main != other
        )
        return _opening(code) if is_corner else None
    if r == 5 and direct == 2 and (p + b + q + p + a + q_) % 2 == 0:
        return 2 * next(i for i in free if i % 2 == 1)
    if r == 6 and direct == 3 and main + other == 3:
        first, second = free
        return (first + second + (8 if second - first > 4 else 0)) % 16
    return _opening(code) if r == 7 else None
