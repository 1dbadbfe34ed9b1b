"""Tables of the study, in the form of the thesis's."""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.benchmarks.studies.sparse import thesis_figures as thesis
from lidarium.benchmarks.studies.sparse.paths import (
    COLLIDES,
    DISPERSION,
    LENGTH,
    POINTS,
    RAW_DISPERSION,
    RAW_TURNING,
    SECONDS,
    TURNING,
)
from lidarium.evaluation.report.tables import markdown_table

Line = Mapping[str, Any]

MEASURES = (
    ("length", "length [m], table 5.7", LENGTH, 3, 1.0),
    ("points", "points, table 5.8", POINTS, 1, 1.0),
    ("seconds", "time [ms], table 5.9", SECONDS, 3, 1e3),
    ("dispersion", "dispersion [m], table 5.10", DISPERSION, 3, 1.0),
    ("turning", "turning [rad], table 5.11", TURNING, 2, 1.0),
)
RAW = {"dispersion": RAW_DISPERSION, "turning": RAW_TURNING}
PLANNERS = ("grid", "laser", "incremental", "full", "thesis incremental", "thesis full")


def answers_of(line: Line, planner: str) -> NDArray[np.float64]:
    """Return what is kept of a planner's answers, (requests, 8); nan if there was no path."""
    nothing = [math.nan] * (COLLIDES + 1)
    return np.array([nothing if each is None else each for each in line["answers"][planner]])


def answered(line: Line, planner: str) -> NDArray[np.bool_]:
    """Return which requests a planner has answered."""
    return ~np.isnan(answers_of(line, planner)[:, LENGTH])


PATH_HEADER = ("grid", "sparse", "by the thesis", "printed: navigation stack", "sparse")


def measure_table(lines: Sequence[Line]) -> str:
    """Return means and standard deviations of all measures and usages."""
    rows = [
        [title, line["place"], usage, *_path_cells(line, usage, name, column, digits, unit, _spread)]
        for name, title, column, digits, unit in MEASURES
        for line in lines
        for usage in thesis.USAGES
    ]
    return markdown_table(("measure", "place", "usage", *PATH_HEADER), rows)


def mean_table(lines: Sequence[Line]) -> str:
    """Return means of all measures on incremental maps."""
    rows = [
        [title, line["place"], *_path_cells(line, "incremental", name, column, digits, unit, _mean)]
        for name, title, column, digits, unit in MEASURES
        for line in lines
    ]
    return markdown_table(("measure", "place", *PATH_HEADER), rows)


def _path_cells(
    line: Line,
    usage: str,
    name: str,
    column: int,
    digits: int,
    unit: float,
    shown: Callable[[NDArray[np.float64], int], str],
) -> list[str]:
    """Return a measure over the requests that the grid and the sparse map answer, beside the printed figures."""
    both = answered(line, "grid") & answered(line, usage)
    cells = [shown(answers_of(line, planner)[both, column] * unit, digits) for planner in ("grid", usage)]
    printed_form = f"thesis {usage}"
    own = answered(line, "grid") & answered(line, printed_form)
    # The thesis measures at the points as they are.
    raw = RAW.get(name, column)
    place = list(thesis.PLACES).index(line["place"])
    printed = [f"{value * unit:.{digits}f}" for value in thesis.MEANS[name][usage][place]]
    return [*cells, shown(answers_of(line, printed_form)[own, raw] * unit, digits), *printed]


def _mean(values: NDArray[np.float64], digits: int) -> str:
    return f"{values.mean():.{digits}f}" if len(values) else "-"


def _spread(values: NDArray[np.float64], digits: int) -> str:
    if len(values) == 0:
        return "-"
    return f"{values.mean():.{digits}f} ± {values.std():.{digits}f}"


def failure_table(lines: Sequence[Line]) -> str:
    """Return how many requests each planner leaves, and how many of its paths collide."""
    header = ("place", *(f"{name}: none, collide" for name in PLANNERS))
    rows = []
    for line in lines:
        cells = []
        for name in PLANNERS:
            found = answers_of(line, name)
            missing = int(np.isnan(found[:, LENGTH]).sum())
            cells.append(f"{missing}, {int(np.nansum(found[:, COLLIDES]))}")
        rows.append([line["place"], *cells])
    return markdown_table(header, rows)


def thesis_failure_table(lines: Sequence[Line]) -> str:
    """Return failures of the grid and of the thesis's form, besides what it prints."""
    header = ("place", "usage", "grid none", "thesis's form none", "both", "printed")
    rows = []
    for line in lines:
        for usage in thesis.USAGES:
            grid, own = answered(line, "grid"), answered(line, f"thesis {usage}")
            place = list(thesis.PLACES).index(line["place"])
            printed = ", ".join(map(str, thesis.FAILURES[usage][place]))
            counts = [str(int(value)) for value in ((~grid).sum(), (~own).sum(), (grid & own).sum())]
            rows.append([line["place"], usage, *counts, printed])
    return markdown_table(header, rows)


def printed_failures() -> str:
    """Say how many requests have no path in the thesis."""
    found = [counts for by_place in thesis.FAILURES.values() for counts in by_place]
    grid, sparse = ([counts[k] for counts in found] for k in (0, 1))
    return (
        f"The thesis prints {min(grid)} to {max(grid)} requests of 1,000 without a path on grids, and {min(sparse)} to "
        f"{max(sparse)} on sparse maps."
    )


def node_table(lines: Sequence[Line]) -> str:
    """Return free and occupied codes, tables 5.5 and 5.6."""
    header = ("place", "usage", "free", "boxes", "graph: nodes, edges", "by the thesis: free, occupied", "printed")
    rows = []
    for line in lines:
        for usage in thesis.USAGES:
            own, form = line["maps"][usage], line["maps"][f"thesis {usage}"]
            nodes, edges = line["graphs"][usage]
            printed = ", ".join(map(str, thesis.NODES[usage][line["place"]]))
            rows.append(
                [
                    line["place"],
                    usage,
                    f"{own['free']:,}",
                    f"{own['occupied']:,}",
                    f"{nodes:,}, {edges:,}",
                    f"{form['free']}, {form['occupied']}",
                    printed,
                ]
            )
    return markdown_table(header, rows)


def memory_table(lines: Sequence[Line]) -> str:
    """Return kilobytes on disk, table 5.13."""
    header = (
        "place",
        ".bt",
        ".ot",
        ".bt deflated",
        "incremental",
        "full",
        ".bt / incremental",
        ".bt / full",
        "deflated / incremental",
        "deflated / full",
        "16 B a code / incremental, full",
        "printed: .bt, .ot, text, binary, text, binary",
    )
    rows = []
    for line in lines:
        bits, full, deflated = line["tree"]
        sizes = [line["maps"][usage] for usage in thesis.USAGES]
        own = [size["binary"] for size in sizes]
        against = ", ".join(f"{size['thesis_binary'] / size['binary']:.1f}" for size in sizes)
        rows.append(
            [
                line["place"],
                *(f"{value / 1e3:.1f}" for value in (bits, full, deflated, *own)),
                *(f"{bits / value:.1f}" for value in own),
                *(f"{deflated / value:.2f}" for value in own),
                against,
                ", ".join(map(str, thesis.KILOBYTES[line["place"]])),
            ]
        )
    return markdown_table(header, rows)


ERROR_HEADER = ("clouds", "codes", "K-means", "LBG", "K-means++", "K-means++ / K-means", "K-means", "LBG", "K-means++")


def error_table(lines: Sequence[Line], codes: Sequence[int] = (16, 32, 64, 128, 256, 512)) -> str:
    """Return mean distances and times of the quantisers by kind of cloud, tables 5.3 and 5.4."""
    rows = []
    for kind, own in _by_kind(lines).items():
        for count in codes:
            found = {method: _means(own, method, count) for method in ("kmeans", "lbg", "kmeans++")}
            errors = [f"{found[method][0]:.4f}" for method in found]
            times = [f"{1e3 * found[method][1]:.1f}" for method in found]
            ratio = f"{found['kmeans++'][0] / found['kmeans'][0]:.3f}"
            rows.append([kind, str(count), *errors, ratio, *times])
    return markdown_table(ERROR_HEADER, rows)


def _by_kind(lines: Sequence[Line]) -> dict[str, list[Line]]:
    kinds: dict[str, list[Line]] = {}
    for line in lines:
        kinds.setdefault(line["kind"], []).append(line)
    return kinds


def _means(lines: Sequence[Line], method: str, codes: int) -> tuple[float, float]:
    """Return mean distance [m] and time [s] over clouds."""
    found = [each for line in lines for each in line["figures"][method] if int(each[0]) == codes]
    return float(np.mean([each[1] for each in found])), float(np.mean([each[3] for each in found]))


def thesis_error_table() -> str:
    """Return what the thesis prints of errors and times."""
    methods = ("K-means", "K-means on a GPU", "LBG", "K-means++")
    rows = []
    for kind, by_codes in thesis.ERRORS.items():
        for codes, errors in by_codes.items():
            seconds = thesis.SECONDS[kind][codes]
            cells = [*(f"{value:.4f}" for value in errors), f"{errors[3] / errors[0]:.3f}"]
            rows.append([kind, str(codes), *cells, *(f"{1e3 * value:,.0f}" for value in seconds)])
    return markdown_table(("clouds", "codes", *methods, "K-means++ / K-means", *methods), rows)


def gpu_text(lines: Sequence[Line], codes: int = 512) -> str:
    """Say how long K-means takes on one core here, and on the thesis's GPU and CPU."""
    ours = [f"{1e3 * _means(own, 'kmeans', codes)[1]:.0f} ({kind})" for kind, own in _by_kind(lines).items()]
    theirs = [(kind, by_codes[codes]) for kind, by_codes in thesis.SECONDS.items()]
    gpu = ", ".join(f"{1e3 * seconds[1]:,.0f} ({kind})" for kind, seconds in theirs)
    faster = ", ".join(f"{seconds[0] / seconds[1]:.1f}" for _, seconds in theirs)
    return (
        f"K-means of {codes} codes takes {', '.join(ours)} ms here on one core. On the thesis's GPU it took {gpu} ms, "
        f"{faster} times as fast as on its CPU. Clouds and machines are others."
    )
