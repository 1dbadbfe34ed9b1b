"""Times as multiples of what a team needs that knows the floor."""

from collections.abc import Sequence

import numpy as np

from lidarium.evaluation.analysis.episodes import Row


def over_bound(rows: Sequence[Row], horizon_s: float) -> float | None:
    """Return the median of the times to 99 % over their bounds.

    Parameters
    ----------
    rows : sequence of dict
        Episodes with ``bound_s``; those without it are left out.
    horizon_s : float
        What counts for runs that did not get to 99 % [s].

    Returns
    -------
    float or None
        None where no episode has a bound.
    """
    multiples = [
        (horizon_s if row["t99_s"] is None else row["t99_s"]) / row["bound_s"]
        for row in rows
        if row.get("bound_s")
    ]
    return float(np.median(multiples)) if multiples else None
