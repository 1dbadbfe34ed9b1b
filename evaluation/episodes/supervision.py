"""What a supervisor did in an episode: its figures, with its log."""

import json
from typing import Any

from lidarium.agents.policy import Policy
from lidarium.agents.supervisor.log import Decision, StationEvent
from lidarium.agents.supervisor.policy import Supervised
from lidarium.envs.radio.messages import OrderKind
from lidarium.evaluation.metrics import decision_percentiles


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
