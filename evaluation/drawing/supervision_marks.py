"""Marks of a supervisor's decisions on pictures, with those on films."""

from collections.abc import Callable, Iterable, Iterator

import cv2
import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from lidarium.agents.policy import Policy
from lidarium.agents.report import GivenOrder, PolicyReport
from lidarium.envs.drawing.frame_parts import SHIFT, Frame, View, team_colours
from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.onboard.radio.messages import OrderKind
from lidarium.evaluation.drawing.picture_parts import INK, hex_colours
from lidarium.evaluation.episodes.events import in_floor_frame

DrawOver = Callable[[ExplorationEnv, Frame, View], None]
"""Draws on a frame, given the environment and the view of the floor."""

SHOWN_S = 4.0
"""Time for which a film shows an order or a join [s]."""

_JOIN_COLOUR = "#0f766e"


def draw_supervision(axes: Axes, env: ExplorationEnv, report: PolicyReport) -> list[Line2D]:
    """Draw the positions at which rules joined, redirected and stopped robots; return the legend.

    They are drawn on a map of the floor.
    """
    station = report.supervision
    if station is None:
        return []
    colours = dict(zip(env.possible_agents, hex_colours(env.settings.robots), strict=True))
    drawn: dict[str, Line2D] = {}
    for agent, start, end in _redirections(env, station.orders):
        axes.annotate(
            "",
            end,
            start,
            arrowprops={"arrowstyle": "->", "color": colours[agent], "linestyle": ":", "alpha": 0.8},
            zorder=5,
        )
        drawn["redirected"] = Line2D([], [], color=INK, linestyle=":", label="redirected")
    for order in station.orders:
        if order.kind is OrderKind.STOP:
            x, y = in_floor_frame(env, order.agent, *order.place)
            axes.plot(
                [x],
                [y],
                marker="s",
                markersize=6,
                color=colours[order.agent],
                markeredgecolor="white",
                linewidth=0,
                zorder=9,
            )
            drawn["stopped"] = Line2D(
                [], [], marker="s", markersize=6, color=INK, linewidth=0, label="stopped by the supervisor"
            )
    for join in station.joins:
        if join.is_used:
            x, y = in_floor_frame(env, join.b, *join.at)
            axes.plot(
                [x],
                [y],
                marker="*",
                markersize=11,
                color=_JOIN_COLOUR,
                markeredgecolor="white",
                linewidth=0,
                zorder=9,
            )
            drawn["joined"] = Line2D(
                [], [], marker="*", markersize=10, color=_JOIN_COLOUR, linewidth=0, label="maps joined"
            )
    return list(drawn.values())


def recent_supervision(policy: Policy) -> DrawOver:
    """Return a function that draws a station's latest orders and joins on frames.

    It draws nothing if a policy has no station.
    """

    def draw(env: ExplorationEnv, frame: Frame, view: View) -> None:
        station = policy.report().supervision
        if station is None:
            return
        since = env.scorer.time - SHOWN_S
        colours = dict(zip(env.possible_agents, team_colours(env.settings.robots), strict=True))
        for agent, start, end in _redirections(env, [one for one in station.orders if one.time_s >= since]):
            first, last = ((int(x), int(y)) for x, y in view.pixels(np.array([start, end])))
            cv2.line(frame, first, last, colours[agent], 2, cv2.LINE_AA, SHIFT)
            cv2.circle(frame, last, round(8 * (1 << SHIFT)), colours[agent], 2, cv2.LINE_AA, SHIFT)
        joined = [f"{join.a} + {join.b}" for join in station.joins if join.is_used and join.time_s >= since]
        for line, words in enumerate(joined):
            cv2.putText(
                frame,
                f"joined: {words}",
                (12, 28 + 24 * line),
                cv2.FONT_HERSHEY_SIMPLEX,
                0.6,
                (15, 118, 110),
                2,
                cv2.LINE_AA,
            )

    return draw


def _redirections(
    env: ExplorationEnv, orders: Iterable[GivenOrder]
) -> Iterator[tuple[str, tuple[float, float], tuple[float, float]]]:
    """Yield each redirected robot with its old and new target, in the floor's frame [m]."""
    for order in orders:
        if order.goal is not None:
            yield (
                order.agent,
                in_floor_frame(env, order.agent, *order.place),
                in_floor_frame(env, order.agent, *order.goal),
            )
