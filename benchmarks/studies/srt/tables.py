"""The tables of the page on the sensor-based random tree."""

import math
import statistics
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from lidarium.benchmarks.studies.srt.ablations import VARIANTS
from lidarium.benchmarks.studies.srt.goal_runs import WORLDS

Line = Mapping[str, Any]

PUBLISHED: dict[str, tuple[str, str, str]] = {
    "srt_corridor": ("59 (43 to 63)", "69", "49 (43 to 98)"),
    "srt_l_room": ("53 (48 to 64)", "48", "60 (50 to 86)"),
    "srt_lab": ("14 (14 to 16)", "55", "19 (19 to 23)"),
    "srt_t_junction": ("74 (68 to 74)", "84", "97 (to 106)"),
}
"""Results printed in the thesis: nodes, segments and time [s].

They are of one run, and of an unknown number of runs.
"""

UNHINDERED = WORLDS[:3]
"""Worlds of which the way is compared with the shortest one."""


def goals(lines: Sequence[Line]) -> str:
    """Return the endings, times, nodes and ways of both modes besides the thesis's."""
    rows = [
        "| world | mode | runs | ended | nodes | curves | time [s] | path [m] | of the shortest | area covered | from "
        "the start [m] | contacts |",
        "|---|---|---:|---|---:|---:|---:|---:|---:|---:|---:|---:|",
    ]
    for world in WORLDS:
        if world in PUBLISHED:
            nodes, segments, time = PUBLISHED[world]
            rows.append(f"| {world} | printed | - | reached | {nodes} | {segments} | {time} | - | - | - | - | - |")
        for mode in ("thesis", "default"):
            runs = _of(lines, world, mode)
            if runs:
                rows.append(_goal_row(world, mode, runs))
    return "\n".join(rows)


def _goal_row(world: str, mode: str, runs: Sequence[Line]) -> str:
    ratios = [run["path_m"] / run["shortest_m"] for run in runs if run["shortest_m"] and run["ending"] == "reached"]
    shortest = f"{statistics.median(ratios):.2f} (to {max(ratios):.2f})" if ratios else "-"
    return (
        f"| {world} | {mode} | {len(runs)} | {_endings(runs)} | {_spread(runs, 'nodes', 0)} | "
        f"{_spread(runs, 'curves', 0)} | {_spread(runs, 'time_s', 0)} | {_spread(runs, 'path_m', 1)} | {shortest} | "
        f"{100 * min(run['coverage'] for run in runs):.1f} % | {max(run['from_start_m'] for run in runs):.2f} | "
        f"{sum(run['collisions'] for run in runs)} |"
    )


def against_thesis_mode(lines: Sequence[Line]) -> str:
    """Return the default mode's time, nodes and path over the thesis mode's. The ratios are taken seed by seed."""
    rows = ["| world | time | nodes | path |", "|---|---:|---:|---:|"]
    for world in WORLDS:
        pairs = _pairs(_of(lines, world, "thesis"), _of(lines, world, "default"))
        if pairs:
            cells = [_ratio(pairs, key) for key in ("time_s", "nodes", "path_m")]
            rows.append(f"| {world} | {' | '.join(cells)} |")
    return "\n".join(rows)


def _pairs(first: Iterable[Line], second: Iterable[Line]) -> list[tuple[Line, Line]]:
    by_seed = {run["seed"]: run for run in second}
    return [(run, by_seed[run["seed"]]) for run in first if run["seed"] in by_seed]


def _ratio(pairs: Sequence[tuple[Line, Line]], key: str) -> str:
    ratios = sorted(new[key] / old[key] for old, new in pairs)
    total = sum(new[key] for _, new in pairs) / sum(old[key] for old, _ in pairs)
    return f"{total:.2f} ({ratios[0]:.2f} to {ratios[-1]:.2f})"


def maps(lines: Sequence[Line]) -> str:
    """Return the errors of poses and maps, and the maps' sizes."""
    rows = [
        "| world | mode | ATE [mm] | end [mm] | end [deg] | odometry's ATE over ours | wall error [mm] | its 95 % "
        "[mm] | walls found | curves right | bytes | of end points | of a grid |",
        "|---|---|" + "---:|" * 11,
    ]
    for world in WORLDS:
        for mode in ("thesis", "default"):
            runs = _of(lines, world, mode)
            if runs:
                rows.append(f"| {world} | {mode} | {_map_cells(runs)} |")
    return "\n".join(rows)


def _map_cells(runs: Sequence[Line]) -> str:
    ratios = [run["odometry_ate_m"] / run["ate_m"] for run in runs]
    return " | ".join(
        [
            _worst(runs, "ate_m", 1000.0, 0),
            _worst(runs, "end_m", 1000.0, 0),
            _worst(runs, "end_deg", 1.0, 2),
            f"{statistics.median(ratios):.1f} (from {min(ratios):.1f})",
            _worst(runs, "wall_mean_m", 1000.0, 1),
            _worst(runs, "wall_p95_m", 1000.0, 0),
            _worst(runs, "recall", 100.0, 1, min, " %"),
            _worst(runs, "precision", 100.0, 1, min, " %"),
            _worst(runs, "size_bytes", 1.0, 0),
            _worst(runs, "of_end_points", 100.0, 2, max, " %"),
            _worst(runs, "of_grid", 100.0, 1, max, " %"),
        ]
    )


def trees(lines: Sequence[Line]) -> str:
    """Return what variants of the thesis's rules come to, on each floor."""
    rows = [
        "| floor | tree | runs | ended | nodes | time [s] | path [m] | area covered | contacts |",
        "|---|---|---:|---|---:|---:|---:|---:|---:|",
    ]
    for floor, tree in dict.fromkeys((line["world"], line["mode"]) for line in lines):
        runs = _of(lines, floor, tree)
        rows.append(
            f"| {floor} | {tree} | {len(runs)} | {_endings(runs)} | {_spread(runs, 'nodes', 0)} | "
            f"{_spread(runs, 'time_s', 0)} | {_spread(runs, 'path_m', 1)} | "
            f"{100 * min(run['coverage'] for run in runs):.1f} % | {sum(run['collisions'] for run in runs)} |"
        )
    return "\n".join(rows)


def _endings(runs: Sequence[Line]) -> str:
    return ", ".join(f"{name} {count}" for name, count in sorted(Counter(run["ending"] for run in runs).items()))


def ablations(lines: Sequence[Line]) -> str:
    """Return what each change of a part does to poses and maps, over all worlds."""
    rows = [
        "| variant | about | ATE [mm] | end [mm] | wall error [mm] | its 95 % [mm] | walls found | curves "
        "right | control points | bytes |",
        "|---|---|" + "---:|" * 8,
    ]
    for name, (about, _) in VARIANTS.items():
        runs = [line["variants"][name] for line in lines]
        cells = [
            _worst(runs, "ate_m", 1000.0, 0),
            _worst(runs, "end_m", 1000.0, 0),
            _worst(runs, "wall_mean_m", 1000.0, 1),
            _worst(runs, "wall_p95_m", 1000.0, 0),
            _worst(runs, "recall", 100.0, 1, min, " %"),
            _worst(runs, "precision", 100.0, 1, min, " %"),
            _worst(runs, "control_points", 1.0, 0),
            _worst(runs, "size_bytes", 1.0, 0),
        ]
        rows.append(f"| `{name}` | {about} | {' | '.join(cells)} |")
    return "\n".join(rows)


def exploration(episodes: Sequence[Line], policies: Sequence[str]) -> str:
    """Return times and paths to 99 % by floor.

    They are means over the starts, and the first policy's over the better of the others.
    """
    rows = [
        f"| floor | {' | '.join(f'`{name}` [s], [m]' for name in policies)} | time | path |",
        "|---|" + "---:|" * (len(policies) + 2),
    ]
    all_ratios: list[tuple[float, float]] = []
    for floor in dict.fromkeys(episode["floor"] for episode in episodes):
        figures = {name: _means(episodes, floor, name) for name in policies}
        ours, others = figures[policies[0]], [figures[name] for name in policies[1:]]
        ratios = (ours[0] / min(time for time, _ in others), ours[1] / min(path for _, path in others))
        all_ratios.append(ratios)
        cells = [f"{time:.0f}, {path:.0f}" for time, path in figures.values()]
        rows.append(f"| {floor} | {' | '.join(cells)} | {_shown(ratios[0])} | {_shown(ratios[1])} |")
    if all_ratios:
        means = [_geometric_mean([ratios[k] for ratios in all_ratios]) for k in (0, 1)]
        rows.append(
            f"| all, geometric mean | {' | '.join('' for _ in policies)} | {_shown(means[0])} | {_shown(means[1])} |"
        )
    return "\n".join(rows)


def _means(episodes: Sequence[Line], floor: str, policy: str) -> tuple[float, float]:
    """Return mean time [s] and path [m] to 99 %. Infinite if a run did not get there."""
    runs = [episode for episode in episodes if episode["floor"] == floor and episode["policy"] == policy]
    if not runs or any(run["t99_s"] is None for run in runs):
        return math.inf, math.inf
    return statistics.fmean(run["t99_s"] for run in runs), statistics.fmean(run["d_sum99_m"] for run in runs)


def _geometric_mean(values: Sequence[float]) -> float:
    return (
        math.exp(statistics.fmean(math.log(value) for value in values)) if all(map(math.isfinite, values)) else math.inf
    )


def _shown(ratio: float) -> str:
    return f"{ratio:.2f}" if math.isfinite(ratio) else "never"


def _of(lines: Sequence[Line], world: str, mode: str) -> list[Line]:
    return [line for line in lines if line["world"] == world and line["mode"] == mode]


def _spread(runs: Sequence[Line], key: str, digits: int) -> str:
    values = [run[key] for run in runs]
    return f"{statistics.median(values):.{digits}f} ({min(values):.{digits}f} to {max(values):.{digits}f})"


def _worst(
    runs: Sequence[Line],
    key: str,
    scale: float,
    digits: int,
    worst: Callable[[list[float]], float] = max,
    unit: str = "",
) -> str:
    """Return the mean and, in brackets, the worst of the runs."""
    values = [scale * run[key] for run in runs]
    return f"{statistics.fmean(values):.{digits}f}{unit} ({worst(values):.{digits}f})"
