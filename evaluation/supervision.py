"""What a supervisor did in an episode: its figures, its log, and marks of it on pictures and films."""

import json
from collections.abc import Iterator
from typing import Any

import cv2
import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from lidarium.agents.policy import Policy
from lidarium.agents.supervisor.log import Decision, StationEvent
from lidarium.agents.supervisor.policy import Supervised
from lidarium.envs.exploration import ExplorationEnv
from lidarium.envs.frame_parts import SHIFT, Frame, View, team_colours
from lidarium.envs.onboard.state import OrderKind
from lidarium.evaluation.events import in_floor_frame
from lidarium.evaluation.metrics import decision_percentiles
from lidarium.evaluation.picture_parts import INK, hex_colours
from lidarium.evaluation.video import DrawOver

SHOWN_S = 4.0
"""How long a film shows an order or a join [s]."""

_JOIN_COLOUR = "#0f766e"


def is_supervised(policy: Policy) -> bool:
    """Whether a policy has a supervisor whose episode has begun."""
    return isinstance(policy, Supervised) and policy.has_begun


def supervision_figures(policy: Policy) -> dict[str, Any] | None:
    """Return the entry ``supervisor`` of ``result.json``: how much was decided, and of what kind; None without a supervisor."""
    if not (isinstance(policy, Supervised) and policy.has_begun):
        return None
    orders = [decision.order for decision in policy.decisions]
    rules = sorted({decision.rule for decision in policy.decisions})
    return {
        "decisions": len(orders),
        "redirections": orders.count(OrderKind.GO_TO.value),
        "stops": orders.count(OrderKind.STOP.value),
        "by_rule": {str(rule): sum(decision.rule == rule for decision in policy.decisions) for rule in rules},
        "joined": sum(event.event == "joined" for event in policy.events),
        "dropped": sum(event.event == "dropped" for event in policy.events),
    }


def tick_percentiles(policy: Policy) -> dict[str, float | None] | None:
    """Return the entry ``tick_ms`` of ``result.json``: wall time of looks at the tree and of merges between; None without a supervisor."""
    if not (isinstance(policy, Supervised) and policy.has_begun):
        return None
    ticks, merges = (decision_percentiles(seconds) for seconds in (policy.tick_seconds, policy.merge_seconds))
    return {**ticks, **{f"merge_{name}": value for name, value in merges.items()}}


def decision_lines(policy: Policy) -> str:
    """Return the log of a supervisor, a JSON object in each line, by time: what happened at the station, and every decision."""
    if not (isinstance(policy, Supervised) and policy.has_begun):
        return ""
    entries: list[StationEvent | Decision] = [*policy.events, *policy.decisions]
    entries.sort(key=lambda entry: entry.time_s)
    return "".join(json.dumps(entry.as_dict(), allow_nan=False) + "\n" for entry in entries)


def draw_supervision(axes: Axes, env: ExplorationEnv, policy: Policy) -> list[Line2D]:
    """Draw where robots were joined, redirected and stopped by rules on a map of the floor; return the entries of the legend."""
    if not (isinstance(policy, Supervised) and policy.has_begun):
        return []
    colours = dict(zip(env.possible_agents, hex_colours(env.settings.robots), strict=True))
    drawn: dict[str, Line2D] = {}
    for agent, start, end in _redirections(env, policy.decisions):
        axes.annotate("", end, start, arrowprops={"arrowstyle": "->", "color": colours[agent], "linestyle": ":", "alpha": 0.8}, zorder=5)
        drawn["redirected"] = Line2D([], [], color=INK, linestyle=":", label="redirected")
    for decision in policy.decisions:
        if decision.order == OrderKind.STOP.value:
            x, y = in_floor_frame(env, decision.agent, *decision.place)
            axes.plot([x], [y], marker="s", markersize=6, color=colours[decision.agent], markeredgecolor="white", linewidth=0, zorder=9)
            drawn["stopped"] = Line2D([], [], marker="s", markersize=6, color=INK, linewidth=0, label="stopped by the supervisor")
    for join in policy.joins:
        if join.is_used:
            x, y = in_floor_frame(env, join.b, *join.at)
            axes.plot([x], [y], marker="*", markersize=11, color=_JOIN_COLOUR, markeredgecolor="white", linewidth=0, zorder=9)
            drawn["joined"] = Line2D([], [], marker="*", markersize=10, color=_JOIN_COLOUR, linewidth=0, label="maps joined")
    return list(drawn.values())


def recent_supervision(policy: Policy) -> DrawOver | None:
    """Return what draws on frames of a film where robots have been sent lately, and that maps were joined; None without a supervisor."""
    if not isinstance(policy, Supervised):
        return None

    def draw(env: ExplorationEnv, frame: Frame, view: View) -> None:
        if not policy.has_begun:
            return
        since = env.scorer.time - SHOWN_S
        colours = dict(zip(env.possible_agents, team_colours(env.settings.robots), strict=True))
        for agent, start, end in _redirections(env, [one for one in policy.decisions if one.time_s >= since]):
            first, last = ((int(x), int(y)) for x, y in view.pixels(np.array([start, end])))
            cv2.line(frame, first, last, colours[agent], 2, cv2.LINE_AA, SHIFT)
            cv2.circle(frame, last, round(8 * (1 << SHIFT)), colours[agent], 2, cv2.LINE_AA, SHIFT)
        joined = [f"{join.a} + {join.b}" for join in policy.joins if join.is_used and join.time_s >= since]
        for line, words in enumerate(joined):
            cv2.putText(frame, f"joined: {words}", (12, 28 + 24 * line), cv2.FONT_HERSHEY_SIMPLEX, 0.6, (15, 118, 110), 2, cv2.LINE_AA)

    return draw


def _redirections(env: ExplorationEnv, decisions: list[Decision]) -> Iterator[tuple[str, tuple[float, float], tuple[float, float]]]:
    """Yield who was redirected from where to where, in the floor's frame [m]."""
    for decision in decisions:
        if decision.goal is not None:
            yield decision.agent, in_floor_frame(env, decision.agent, *decision.place), in_floor_frame(env, decision.agent, *decision.goal)
