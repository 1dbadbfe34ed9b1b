"""Rules for when an episode of an evaluation ends, from other projects.

They apply in addition to the environment's settings.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Annotated, Any

from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.evaluation.episodes.history import History
from lidarium.mapping.geometry.bounds import Count, check_settings, shown, within

_FIGURES: dict[str, Callable[[ExplorationEnv, History], float]] = {
    "c_free": lambda env, _: env.scorer.coverage,
    "c_known": lambda _, history: float(history.curves.c_known[-1]),
    "c_valid": lambda _, history: float(history.curves.c_valid[-1]),
    "c_own_min": lambda _, history: float(history.curves.c_own[-1].min()),
    "remaining_cells": lambda env, _: float(env.score.counted[0] - env.score.team_seen[0]),
}
"""Figures of rules, as docs/reference/metrics.md defines them.

``remaining_cells`` are those of F that are not sensed.
"""

STOP_REASON = "stop_rule"
"""Why robots ended that a rule has ended."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StopRule:
    """Ends an episode if a figure is good enough, or after some decisions.

    Attributes
    ----------
    figure : str or None
        ``c_free``, ``c_known``, ``c_valid``, ``c_own_min`` or ``remaining_cells``.
    at_least, above, at_most : float or None
        Bound of the figure; one of them.
    decisions : int or None
        After how many decisions the episode ends in any case. At the levels ``velocity`` and ``waypoint`` each
        decision period of the settings counts as one, however often the policy decides.
    """

    figure: str | None = None
    at_least: Annotated[float, within(-1e12, 1e12)] | None = None
    above: Annotated[float, within(-1e12, 1e12)] | None = None
    at_most: Annotated[float, within(-1e12, 1e12)] | None = None
    decisions: Count | None = None

    def __post_init__(self) -> None:
        check_settings(self, "the stop rule")
        bounds = [bound for bound in (self.at_least, self.above, self.at_most) if bound is not None]
        if self.figure is not None and self.figure not in _FIGURES:
            raise ValueError(f"figure of the stop rule is {self.figure!r}; want one of {', '.join(_FIGURES)}")
        if len(bounds) != (0 if self.figure is None else 1):
            raise ValueError(
                f"the stop rule asks for {self.figure!r} with {len(bounds)} bounds; want a figure with one "
                "of at_least, above, at_most"
            )
        if self.figure is None and self.decisions is None:
            raise ValueError("the stop rule ends nothing; want a figure with its bound, decisions, or both")

    def is_met(self, env: ExplorationEnv, history: History, decisions: int) -> bool:
        """Whether the episode ends now, after that many decisions."""
        return (self.decisions is not None and decisions >= self.decisions) or self.is_reached(env, history)

    def is_reached(self, env: ExplorationEnv, history: History) -> bool:
        """Whether the figure is good enough; False for a rule of decisions alone."""
        if self.figure is None:
            return False
        value = _FIGURES[self.figure](env, history)
        if self.at_least is not None:
            return value >= self.at_least
        return value > self.above if self.above is not None else value <= (self.at_most or 0.0)


_CLOCKED = frozenset({"velocity", "waypoint"})
"""Levels at which decisions are as long as policies want; otherwise a decision is a move."""


class Stopper:
    """Stops all robots of an episode by a rule.

    Called after every decision, as ``run_episode`` calls ``on_decision``.
    """

    def __init__(self, rule: StopRule, history: History) -> None:
        self._rule, self._history, self._decisions = rule, history, -1

    def __call__(self, env: ExplorationEnv) -> None:
        """Look at the episode after its reset and after every decision."""
        self._decisions += 1
        if env.level in _CLOCKED:
            self._decisions = math.floor(env.scorer.time / env.settings.decision_period_s + 1e-9)
        if env.agents and self._rule.is_met(env, self._history, self._decisions):
            for agent in env.agents:
                env.stop(agent, STOP_REASON)


def stop_rule_of(content: Mapping[str, Any] | None, robots: int = 1) -> StopRule | None:
    """Make a rule of the content of a suite's file for a team; ``decisions`` may be a table by the number of robots."""
    if content is None:
        return None
    if not isinstance(content, Mapping):
        raise ValueError(f"the stop rule is {shown(content)}; want a table, as in [stop]")
    known = StopRule.__dataclass_fields__
    unknown = sorted(set(content) - set(known))
    if unknown:
        raise ValueError(f"a stop rule has no {unknown[0]!r}; it has {', '.join(known)}")
    decisions = content.get("decisions")
    if isinstance(decisions, Mapping):
        if str(robots) not in decisions:
            raise ValueError(f"decisions of the stop rule is {shown(decisions)}, without an entry for {robots} robots")
        return StopRule(**{**content, "decisions": decisions[str(robots)]})
    return StopRule(**content)
