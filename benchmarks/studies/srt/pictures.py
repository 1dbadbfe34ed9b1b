"""Pictures of the worlds, and curves of coverage.

They show the tree, its safe regions and the map of curves over the truth.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from lidarium.benchmarks.studies.srt.goal_runs import (
    CURVE_PERIOD,
    MODES,
    SETTINGS,
    WORLDS,
    GoalRun,
    drive_to_goal,
    tracker_of,
)
from lidarium.evaluation.drawing.spline_picture import save_spline_picture
from lidarium.mapping.files.output import whole_file

COLOURS = {"thesis": "#6b7280", "default": "#2563eb"}


def draw_world(path: Path, world: str, seed: int) -> None:
    """Draw what a run in the default mode left."""
    episode, policy, way = drive_to_goal(GoalRun("default", world, seed))
    env, tree = episode.env, policy.tree
    assert env.floor is not None
    agent = env.possible_agents[0]
    origin = np.array(env.belief(agent).map_origin) + np.array(way.believed[-1][:2]) - env.belief(agent).pose[:2]
    places = [node.place + origin for node in tree.nodes]
    edges = [(_pair(places[node.parent]), _pair(places[node.number])) for node in tree.nodes if node.parent is not None]
    regions = [place + node.safe.outline for place, node in zip(places, tree.nodes, strict=True)]
    save_spline_picture(
        path, env.floor, tracker_of(env).map, np.array(way.true), np.array(way.believed), edges, safe_regions=regions
    )


def _pair(place: np.ndarray[Any, Any]) -> tuple[float, float]:
    return float(place[0]), float(place[1])


def draw_coverage(path: Path, lines: Sequence[Mapping[str, Any]]) -> None:
    """Draw the covered area over time of all runs, a panel for each world."""
    figure = Figure(figsize=(11.0, 6.0), dpi=110, layout="constrained")
    FigureCanvasAgg(figure)
    for axes, world in zip(figure.subplots(2, 3).ravel(), WORLDS, strict=True):
        for mode in MODES:
            for line in (line for line in lines if line["world"] == world and line["mode"] == mode):
                shares = np.array(line["coverage_curve"])
                times = np.minimum(np.arange(len(shares)) * CURVE_PERIOD * _TIME_STEP, line["time_s"])
                label = mode if mode not in axes.get_legend_handles_labels()[1] else None
                axes.plot(times, 100.0 * shares, color=COLOURS[mode], linewidth=0.8, alpha=0.6, label=label)
        axes.set_title(world, fontsize=9)
        axes.set_xscale("symlog", linthresh=10.0)
        axes.set_xlabel("time [s]", fontsize=8)
        axes.set_ylabel("area covered [%]", fontsize=8)
        if axes.get_legend_handles_labels()[1]:
            axes.legend(fontsize=8, frameon=False)
    with whole_file(path) as beside:
        figure.savefig(beside)


_TIME_STEP = float(SETTINGS.get("time_step", 0.1))
