"""The supervisor's log: decisions with their causes, and station events."""

import math
from dataclasses import asdict, dataclass
from typing import Any

from lidarium.agents.supervisor.tree import RobotInputs


@dataclass(frozen=True, slots=True)
class Decision:
    """Decision of the tree about a robot.

    Attributes
    ----------
    time_s : float
        When [s].
    agent : str
        The robot.
    group : tuple of str
        The robots that it is joined with, itself included.
    inputs : RobotInputs
        Knowledge of the tree about it.
    rival : RobotInputs or None
        The same of the robot that has its goal, or that it would meet.
    answers : tuple of (str, bool)
        The questions on the way through the tree, and their answers.
    rule : int
        The rule that decided, 0 if none applies.
    order : str or None
        The order, None if the robot goes on.
    why : str
        In words.
    place : (float, float)
        Its position, in its own map frame [m].
    goal : (float, float) or None
        Its goal, in its own map frame [m].
    """

    time_s: float
    agent: str
    group: tuple[str, ...]
    inputs: RobotInputs
    rival: RobotInputs | None
    answers: tuple[tuple[str, bool], ...]
    rule: int
    order: str | None
    why: str
    place: tuple[float, float]
    goal: tuple[float, float] | None = None

    def as_dict(self) -> dict[str, Any]:
        """Return it as values for JSON."""
        return {
            "event": "decision",
            "time_s": round(self.time_s, 6),
            "agent": self.agent,
            "group": list(self.group),
            "inputs": _inputs(self.inputs),
            "rival": None if self.rival is None else _inputs(self.rival),
            "answers": dict(self.answers),
            "rule": self.rule,
            "order": self.order,
            "why": self.why,
            "place": [round(value, 4) for value in self.place],
            "goal": None if self.goal is None else [round(value, 4) for value in self.goal],
        }


@dataclass(frozen=True, slots=True)
class StationEvent:
    """Something that happened at the station.

    Attributes
    ----------
    time_s : float
        When [s].
    event : str
        ``found`` (two maps were found to be of one place, which is to be confirmed), ``joined``, ``dropped``
        (a join that is believed no more), ``excluded`` (a robot has failed), ``late`` (a report that is older
        than the last one), ``unusable`` (a map of nothing).
    agents : tuple of str
        Whom it is about.
    words : str
        More about it.
    """

    time_s: float
    event: str
    agents: tuple[str, ...]
    words: str = ""

    def as_dict(self) -> dict[str, Any]:
        """Return it as values for JSON."""
        return {
            "event": self.event,
            "time_s": round(self.time_s, 6),
            "agents": list(self.agents),
            "words": self.words,
        }


def _inputs(inputs: RobotInputs) -> dict[str, Any]:
    values = asdict(inputs)
    finite = {
        name: value if not isinstance(value, float) or math.isfinite(value) else None for name, value in values.items()
    }
    return {name: round(value, 4) if isinstance(value, float) else value for name, value in finite.items()} | {
        "state": inputs.state.value
    }
