"""Performance profiles of a group of episodes."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from lidarium.evaluation.analysis.episodes import pair_key_of
from lidarium.evaluation.analysis.figures import TIMES
from lidarium.evaluation.analysis.groups import Group, times_to
from lidarium.evaluation.drawing.style import band, colours, dash, dress, legend, save
from lidarium.evaluation.statistics import ratio_profile, score_profile

COVERAGE_STEPS = 200
"""Number of coverage thresholds up to the whole.

With it, those at which episodes end (90, 95, 99 %) are among the thresholds.
"""

FACTORS = np.geomspace(1.0, 4.0, 121)
_MOST_BANDS = 5
"""Intervals of more policies than this would hide each other.

They are in ``report.json`` all the same.
"""


def profiles(group: Group) -> dict[str, Any]:
    """Return the performance profiles of all policies, for plot and ``report.json``."""
    factor = {}
    for key in TIMES:
        costs = _paired_costs(group, key)
        if len(costs):
            shares = ratio_profile(costs, FACTORS)
            factor[key] = {
                "runs": len(costs),
                "factors": FACTORS.tolist(),
                "shares": dict(zip(group.runs, shares.tolist(), strict=True)),
            }
    lowest = min(row["coverage_final"] for rows in group.runs.values() for row in rows)
    thresholds = np.arange(10 * min(int(20.0 * lowest), 19), COVERAGE_STEPS + 1) / COVERAGE_STEPS
    scores = {
        policy: score_profile([row["coverage_final"] for row in rows], thresholds).tolist()
        for policy, rows in group.runs.items()
    }
    return {
        "within_factor": factor,
        "coverage_at_least": {"thresholds": thresholds.tolist(), "share_low_high": scores},
    }


def save_profiles(path: Path, group: Group, found: dict[str, Any]) -> None:
    """Draw the performance profiles."""
    panels = [*found["within_factor"], "coverage"]
    figure = Figure(figsize=(4.3 * len(panels), 4.7), layout="constrained")
    chosen = colours(len(group.runs))
    is_banded = len(group.runs) <= _MOST_BANDS
    for k, panel in enumerate(panels):
        axes = figure.add_subplot(1, len(panels), k + 1)
        if panel == "coverage":
            curve = found["coverage_at_least"]
            x = 100.0 * np.array(curve["thresholds"])
            for index, (share, low, high) in enumerate(curve["share_low_high"].values()):
                _draw_share(axes, x, share, index, chosen[index], "pre")
                if is_banded:
                    band(axes, x, 100.0 * np.array(low), 100.0 * np.array(high), chosen[index], "pre")
            dress(axes, "coverage at the end", "coverage of at least [%]", "share of runs [%]")
            axes.set_xlim(float(x[0]), 100.0)
        else:
            curve = found["within_factor"][panel]
            for index, share in enumerate(curve["shares"].values()):
                _draw_share(axes, np.array(curve["factors"]), share, index, chosen[index], "post")
            dress(
                axes,
                f"{TIMES[panel]}, {curve['runs']} paired runs",
                "within this factor of the fastest policy",
                "share of runs [%]",
            )
            axes.set_xscale("log")
            axes.set_xticks([1.0, 1.25, 1.5, 2.0, 3.0, 4.0], ["1", "1.25", "1.5", "2", "3", "4"])
            axes.minorticks_off()
            axes.set_xlim(1.0, FACTORS[-1])
        axes.set_ylim(0.0, 102.0)
    handles = [Line2D([], [], color=chosen[k], linestyle=dash(k), linewidth=1.9) for k in range(len(chosen))]
    legend(figure, list(group.runs), handles)
    shaded = "shaded: 95 % interval of the share (Wilson); " if is_banded else ""
    save(
        path,
        figure,
        f"Performance profiles: {group.title}",
        f"{shaded}runs that did not get there count as missed",
    )


def _paired_costs(group: Group, key: str) -> NDArray[np.float64]:
    """Return the times (runs, policies) of the runs that all policies have.

    They are inf where the share was not reached.
    """
    by_policy = [
        dict(zip(map(pair_key_of, rows), times_to(rows, key, group.horizon_s).or_never, strict=True))
        for rows in group.runs.values()
    ]
    shared = [pair for pair in by_policy[0] if all(pair in times for times in by_policy)]
    return np.array([[times[pair] for times in by_policy] for pair in shared]).reshape(
        len(shared), len(by_policy)
    )


def _draw_share(
    axes: Axes,
    x: NDArray[np.float64],
    share: Sequence[float],
    index: int,
    colour: str,
    where: Any,  # noqa: ANN401
) -> None:
    axes.step(
        x,
        100.0 * np.asarray(share),
        where=where,
        color=colour,
        linestyle=dash(index),
        linewidth=1.9,
        zorder=3,
    )
