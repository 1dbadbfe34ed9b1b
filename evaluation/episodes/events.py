"""Events of an episode for JSON: orders, states and merges in words.

Positions are in the floor's frame.
"""

import json
import math
from collections.abc import Sequence
from typing import Any

from lidarium.agents.report import PolicyReport
from lidarium.envs.faces.merged_maps import MergeEvent
from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.onboard.station.operating import OperatingEvent
from lidarium.evaluation.metrics.merges import transform_error


def in_floor_frame(env: ExplorationEnv, agent: str, x: float, y: float) -> tuple[float, float]:
    """Return a position of a robot's map frame in the floor's frame [m]."""
    row = env.possible_agents.index(agent)
    if env.settings.known_starts:
        offset = env.perception.poses.offset(row)
        return float(x + offset[0]), float(y + offset[1])
    start_x, start_y, theta = env.world.starts[row]
    return (
        float(start_x + math.cos(theta) * x - math.sin(theta) * y),
        float(start_y + math.sin(theta) * x + math.cos(theta) * y),
    )


def place_of(env: ExplorationEnv, agent: str, place: tuple[float, float] | None) -> dict[str, float | None]:
    """Return a position of a robot's map frame as an event has it.

    It has ``x`` and ``y`` in the floor's frame to a millimetre, null for none.
    """
    if place is None:
        return {"x": None, "y": None}
    x, y = in_floor_frame(env, agent, *place)
    return {"x": round(x, 3), "y": round(y, 3)}


def operating_events(env: ExplorationEnv) -> list[dict[str, Any]]:
    """Return the events of the robots' operating states and orders, by time."""
    return [_operating_event(env, event) for event in env.operating.events[0]]


def _operating_event(env: ExplorationEnv, event: OperatingEvent) -> dict[str, Any]:
    row = {"time_s": round(event.time_s, 6), "kind": event.kind, "agent": event.agent}
    row["state" if event.kind == "state" else "order"] = event.what
    place = {} if event.target is None else place_of(env, event.agent, (event.target.x, event.target.y))
    return {**row, **place, "reason": event.reason}


def merge_event(env: ExplorationEnv, merge: MergeEvent) -> dict[str, Any]:
    """Return a merge as an event of the record.

    It has the joined robots, the position, and the error relative to the truth.
    """
    distance, angle = transform_error(merge.found, merge.true, merge.at)
    place = place_of(env, merge.b, merge.at)
    errors = {"error_m": round(distance, 6), "error_rad": round(angle, 6)}
    return {
        "time_s": round(merge.time_s, 6),
        "kind": "merge",
        "agent": merge.a,
        "other": merge.b,
        **place,
        **errors,
    }


def decision_lines(report: PolicyReport) -> str:
    """Return the log of a station, a JSON object in each line, by time."""
    entries = () if report.supervision is None else report.supervision.log
    return "".join(json.dumps(entry.as_dict(), allow_nan=False) + "\n" for entry in entries)


def joined_groups(report: PolicyReport, agents: Sequence[str]) -> tuple[list[set[int]], list[tuple[int, int]]]:
    """Return which robots' maps a station has joined, and by which pairs; robots are places in ``agents``.

    Each robot is in one group; a robot that is not joined is alone in it, as are all without a station.
    """
    groups, pairs = [{robot} for robot in range(len(agents))], list[tuple[int, int]]()
    for join in () if report.supervision is None else report.supervision.joins:
        a, b = agents.index(join.a), agents.index(join.b)
        one, other = (next(group for group in groups if robot in group) for robot in (a, b))
        if join.is_used and one is not other:
            groups = [each for each in groups if each not in (one, other)] + [one | other]
            pairs.append((a, b))
    return groups, pairs
