"""What a policy costs: the time of its decisions and the memory of the process."""

import sys
from collections.abc import Sequence

import numpy as np


def decision_percentiles(seconds: Sequence[float]) -> dict[str, float | None]:
    """Return the median and 95th percentile of decision times in milliseconds.

    They are None where there was no decision.
    """
    if not len(seconds):
        return {"p50": None, "p95": None}
    half, most = np.percentile(np.asarray(seconds, np.float64) * 1e3, [50.0, 95.0])
    return {"p50": round(float(half), 4), "p95": round(float(most), 4)}


def peak_megabytes() -> float | None:
    """Return the most memory that this process has held so far [1e6 bytes].

    None where the system does not say.
    """
    try:
        import resource
    except ImportError:
        return None
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    # macOS reports bytes, the others kilobytes of 1024.
    return float(peak if sys.platform == "darwin" else peak * 1024) / 1e6
