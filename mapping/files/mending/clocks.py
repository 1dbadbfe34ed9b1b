"""Clocks of logs that jump: single wild stamps are left out, and a clock that restarts is continued."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

FEW = 5
"""So many scans in a row may have wild stamps; where more run backwards the clock has restarted."""


class Clock(NamedTuple):
    """Stamps that never decrease.

    Attributes
    ----------
    stamps : (kept,) float64
        Of the scans that are kept [s].
    kept : (kept,) int64
        Which these are.
    restarts : int
        How often the clock has restarted; the stamps after it follow those before by the median period.
    """

    stamps: NDArray[np.float64]
    kept: NDArray[np.int64]
    restarts: int


def continued(stamps: NDArray[np.float64]) -> Clock:
    """Return stamps in the order of the log.

    A stamp that is before its predecessor is wild itself where those after it go on after the predecessor.
    The predecessors are wild where they are few and those before them are earlier. Else the clock has
    restarted there.

    Parameters
    ----------
    stamps : (n,) float64
        As they were recorded [s]; not finite where there is none.
    """
    finite = stamps[np.isfinite(stamps)]
    steps = np.diff(finite)
    period = float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else 1.0
    runs: list[list[int]] = [[]]
    for k in np.flatnonzero(np.isfinite(stamps)).tolist():
        run = runs[-1]
        if run and stamps[k] < stamps[run[-1]]:
            if _go_on_after(stamps, k, run[-1]):
                continue
            late = sum(stamps[j] > stamps[k] for j in run[-FEW - 1 :])
            if late <= FEW:
                del run[-late:]
            else:
                runs.append(run := [])
        run.append(k)
    kept = np.array([k for run in runs for k in run], np.int64)
    found = stamps[kept].astype(np.float64)
    for first in np.cumsum([len(run) for run in runs])[:-1].tolist():
        found[first:] += found[first - 1] + period - found[first]
    return Clock(found, kept, len(runs) - 1)


def _go_on_after(stamps: NDArray[np.float64], k: int, last: int) -> bool:
    """Whether most of the few stamps that follow k are not before that of the last kept scan."""
    ahead = stamps[k + 1 : k + 1 + FEW]
    ahead = ahead[np.isfinite(ahead)]
    return len(ahead) == 0 or bool(np.median(ahead) >= stamps[last])
