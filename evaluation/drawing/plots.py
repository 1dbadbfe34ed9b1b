"""Plots of a group of episodes: coverage over time, box plots, performance profiles."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from lidarium.evaluation.analysis.episodes import pair_key_of
from lidarium.evaluation.analysis.figures import TIMES, Value, clusters_of
from lidarium.evaluation.analysis.groups import Group, times_to
from lidarium.evaluation.analysis.records import Entry, Key, coverage_at, record_key
from lidarium.evaluation.drawing.picture_parts import FAINT, INK
from lidarium.evaluation.drawing.style import band, colours, dash, dress, legend, save
from lidarium.evaluation.statistics import median_bands, ratio_profile, score_profile

CURVE_POINTS = 181
BOXED = ("path_m", "overlap_percent")
_FEWEST_FOR_BOX = 5
Curves = dict[str, dict[str, Any]]


def coverage_curves(group: Group, records: dict[Key, Entry]) -> Curves:
    """Return the median coverage of each policy over time and its interval [%].

    It is of the policy's recorded runs, for the plot and ``report.json``.

    A run that ends keeps its coverage. Ends of intervals without a bound by the runs (fewer than six) are None.
    """
    times = np.linspace(0.0, group.horizon_s, CURVE_POINTS)
    curves: Curves = {}
    for policy, rows in group.runs.items():
        recorded = [row for row in rows if record_key(row) in records]
        entries = [records[record_key(row)] for row in recorded]
        if not entries:
            continue
        coverages = np.array([coverage_at(entry.coverage, times) for entry in entries])
        bands = 100.0 * median_bands(coverages, clusters=clusters_of(recorded))
        median, low, high = ([float(value) if np.isfinite(value) else None for value in line] for line in bands)
        curves[policy] = {
            "runs": len(entries),
            "times_s": times.tolist(),
            "median_percent": median,
            "low_percent": low,
            "high_percent": high,
        }
    return curves


def save_coverage(path: Path, group: Group, curves: Curves) -> None:
    """Draw coverage over time: the median of the runs with its interval.

    The interval is a pointwise 95 % interval.
    """
    figure = Figure(figsize=(8.4, 5.0), layout="constrained")
    axes = figure.add_subplot()
    shown = list(group.runs)
    for policy, curve in curves.items():
        index = shown.index(policy)
        colour = colours(len(shown))[index]
        axes.plot(
            curve["times_s"],
            curve["median_percent"],
            color=colour,
            linestyle=dash(index),
            linewidth=1.9,
            zorder=3,
        )
        if None not in curve["low_percent"]:
            band(axes, curve["times_s"], curve["low_percent"], curve["high_percent"], colour)
    dress(axes, "", "simulated time [s]", "coverage C_free [%]")
    axes.set_xlim(0.0, _end_of(curves, group.horizon_s))
    axes.set_ylim(0.0, 101.0)
    handles = [
        Line2D([], [], color=colours(len(shown))[k], linestyle=dash(k), linewidth=1.9) for k in map(shown.index, curves)
    ]
    legend(
        figure,
        [f"{policy} ({curve['runs']} run{'s' if curve['runs'] != 1 else ''})" for policy, curve in curves.items()],
        handles,
    )
    has_bands = any(None not in curve["low_percent"] for curve in curves.values())
    shaded = "shaded: its 95 % interval at each time" if has_bands else "too few runs for intervals"
    save(
        path,
        figure,
        f"Coverage over time: {group.title}",
        f"median of the runs; {shaded}; a run that ends keeps its coverage",
    )


def save_boxes(path: Path, group: Group, values: Sequence[Value]) -> None:
    """Draw box plots of times, paths and overlap by policy.

    Runs that missed a share are counted above their box.
    """
    boxed = [
        value
        for value in values
        if value.column.key in BOXED and not (value.column.key == "overlap_percent" and group.robots == 1)
    ]
    panels = len(TIMES) + len(boxed)
    policies = list(group.runs)
    # Names of policies are written at an angle below the axes.
    height = 4.1 + 0.042 * max(map(len, policies))
    figure = Figure(figsize=(max(0.9 + 0.58 * len(policies), 2.5) * panels, height), layout="constrained")
    row_of_axes = [figure.add_subplot(1, panels, k + 1) for k in range(panels)]
    for axes, (key, title) in zip(row_of_axes, TIMES.items(), strict=False):
        found = [times_to(rows, key, group.horizon_s) for rows in group.runs.values()]
        _draw_boxes(axes, [times.up_to_horizon for times in found])
        dress(axes, title, "", "simulated time [s]")
        axes.set_ylim(0.0, 1.16 * group.horizon_s)
        axes.axhline(group.horizon_s, color=FAINT, linewidth=1.0, linestyle=(0, (4, 3)), zorder=1)
        for place, times in enumerate(found, 1):
            missed = int((~times.is_reached).sum())
            if missed:
                text = f"{missed} of {len(times.times)}\nmissed"
                axes.text(
                    place,
                    1.015 * group.horizon_s,
                    text,
                    ha="center",
                    va="bottom",
                    fontsize=7.5,
                    color=INK,
                    linespacing=1.0,
                )
    for axes, value in zip(row_of_axes[len(TIMES) :], boxed, strict=True):
        _draw_boxes(axes, [np.array([value.of(row) for row in rows]) for rows in group.runs.values()])
        dress(axes, value.column.title, "", f"{value.column.title} [{value.column.unit}]")
        axes.set_ylim(bottom=0.0)
    for axes in row_of_axes:
        axes.grid(visible=False, axis="x")
        axes.set_xticks(range(1, len(policies) + 1), policies, rotation=35, ha="right", rotation_mode="anchor")
        axes.tick_params(axis="x", labelsize=8.5, labelcolor=INK, length=0)
        axes.set_xlim(0.4, len(policies) + 0.6)
    note = (
        "box: quartiles and median; whiskers: to 1.5 box heights; dots: runs; dashed: horizon, with the runs "
        "that did not get there"
    )
    save(path, figure, f"Times, paths, overlap: {group.title}", note)


def _end_of(curves: Curves, horizon_s: float) -> float:
    """Return when the last curve has settled.

    The plot then does not show a long part without change.
    """
    rests = []
    for curve in curves.values():
        median, times = np.array(curve["median_percent"]), np.array(curve["times_s"])
        rests.append(float(times[int(np.argmax(median >= median[-1] - 0.05))]))
    return min(1.15 * max(rests), horizon_s) if max(rests) > 0.0 else horizon_s


def _draw_boxes(axes: Axes, samples: Sequence[NDArray[np.float64]]) -> None:
    """Draw a box of each sample, and its values next to each other.

    A box is drawn if the sample is large enough for one.
    """
    chosen = colours(len(samples))
    # Positions of dots have no meaning; they come from a seed so that the picture is reproducible.
    generator = np.random.default_rng(0)
    for place, (sample, colour) in enumerate(zip(samples, chosen, strict=True), 1):
        if len(sample) >= _FEWEST_FOR_BOX:
            drawn: Callable[..., Any] = axes.boxplot
            parts = drawn(
                [sample],
                positions=[place],
                widths=0.58,
                showfliers=False,
                patch_artist=True,
                manage_ticks=False,
            )
            for box in parts["boxes"]:
                box.set(facecolor=f"{colour}2e", edgecolor=colour, linewidth=1.4)
            for line in (*parts["whiskers"], *parts["caps"]):
                line.set(color=colour, linewidth=1.2)
            for line in parts["medians"]:
                line.set(color=colour, linewidth=2.4)
        across = place + generator.uniform(-0.17, 0.17, len(sample))
        axes.scatter(
            across,
            sample,
            s=9,
            color=colour,
            alpha=0.45 if len(sample) > 30 else 0.75,
            linewidths=0,
            zorder=3,
        )


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
        policy: score_profile([row["coverage_final"] for row in rows], thresholds, clusters=clusters_of(rows)).tolist()
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

    They are inf if the share was not reached.
    """
    by_policy = [
        dict(zip(map(pair_key_of, rows), times_to(rows, key, group.horizon_s).or_never, strict=True))
        for rows in group.runs.values()
    ]
    shared = [pair for pair in by_policy[0] if all(pair in times for times in by_policy)]
    return np.array([[times[pair] for times in by_policy] for pair in shared]).reshape(len(shared), len(by_policy))


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
