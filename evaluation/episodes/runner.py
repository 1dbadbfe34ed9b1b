"""Runs a policy through an episode."""

import time
from collections.abc import Callable, Mapping
from contextlib import nullcontext
from dataclasses import dataclass, field
from typing import Any

from lidarium.agents.policy import Policy, check_observed
from lidarium.agents.report import GivenUp, PolicyReport
from lidarium.envs.faces.merged_maps import MergedMaps, true_frames
from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.faces.sparse_planning import SparsePlanning
from lidarium.envs.faces.team import EpisodeTeam
from lidarium.envs.faces.team_exchange import MergeEvent, MergingSettings
from lidarium.evaluation.episodes.events import merge_event
from lidarium.evaluation.episodes.watching import WatchedExploration
from lidarium.evaluation.processes import PatientInterrupt
from lidarium.mapping.kernels.interrupts import interruptible

Progress = Callable[[ExplorationEnv], None]

World = ExplorationEnv | SparsePlanning | MergedMaps


@dataclass(slots=True)
class Episode:
    """The result of an episode, and the environment itself.

    Attributes
    ----------
    env : ExplorationEnv
        The environment at the end of the episode.
    policy : Policy
        The policy.
    seed : int
        The seed of the episode.
    decision_seconds : list of float
        Wall time of each call of the policy and of planning [s].
    wall_seconds : float
        Wall time of the whole episode [s].
    given_up : list of GivenUp
        Frontiers that the policy left unexplored, and why.
    is_interrupted : bool
        Whether the user broke it off.
    merges : list of MergeEvent
        Which robots were joined, if maps are merged: by the environment, or by a policy with a
        station.
    report : PolicyReport
        What the policy reports at the end; empty if that failed.
    report_error : str
        Why it failed; empty if it did not.
    """

    env: ExplorationEnv
    policy: Policy
    seed: int
    decision_seconds: list[float] = field(default_factory=list)
    wall_seconds: float = 0.0
    given_up: list[GivenUp] = field(default_factory=list)
    is_interrupted: bool = False
    merges: list[MergeEvent] = field(default_factory=list)
    report: PolicyReport = field(default_factory=PolicyReport)
    report_error: str = ""


@interruptible
def run_episode(
    policy: Policy,
    env: ExplorationEnv,
    seed: int,
    options: Mapping[str, Any] | None = None,
    on_decision: Progress | None = None,
    raise_interrupt: bool = True,
    merging: bool | MergingSettings | None = None,
    plans_sparsely: bool = False,
    level: str | None = None,
) -> Episode:
    """Run a policy from reset until every robot has ended.

    Parameters
    ----------
    policy : Policy
        The policy; its ``Stop`` ends a robot at its next step.
    env : ExplorationEnv
        The environment; it is switched to the action level.
    seed : int
        Seed of all draws of the environment and the policy.
    options : mapping, optional
        Options of ``reset``.
    on_decision : callable, optional
        Called with the environment after the reset and after every decision.
    raise_interrupt : bool, optional
        Whether ``KeyboardInterrupt`` is raised, True by default. If False, a first Ctrl-C ends the episode
        after the current step and the episode so far is returned; a second one is raised.
    merging : bool or MergingSettings, optional
        Whether robots exchange and merge their maps (`MergedMaps`), and with which settings. No merging by default.
    plans_sparsely : bool, optional
        Whether robots drive along routes on their sparse maps (`SparsePlanning`); False by default.
    level : str, optional
        The level at which the policy's actions are carried out, such as ``graph``; the policy's own by default.

    Returns
    -------
    Episode
        The environment at the end, the seed, wall times, merges and frontiers that were given up.

    Raises
    ------
    ValueError
        If robots lack a sensor that the policy reads, or ``plans_sparsely`` is set for a policy of speeds.

    Examples
    --------
    >>> import lidarium
    >>> env = lidarium.parallel_env("apartment", robots=2, horizon_s=5.0)
    >>> episode = lidarium.run_episode(lidarium.policy("nearest_frontier"), env, seed=0)
    >>> env.scorer.time
    5.0
    """
    if not isinstance(env, ExplorationEnv):
        raise ValueError(f"env is a {type(env).__name__}; want an environment of `parallel_env` without randomize")
    check_observed(policy, policy.name or type(policy).__name__, env.settings.observe, env.conventions)
    env.use_level(level or policy.level, policy.shares_map, policy.decision_period_s)
    env.perception.predicts |= policy.predicts  # before the first frame
    if plans_sparsely and env.driver is None:
        raise ValueError("plans_sparsely is set, but the policy decides speeds; want waypoints or frontiers")
    world: World = SparsePlanning(env, policy.shares_map) if plans_sparsely else env
    if merging:
        world = MergedMaps(world, None if merging is True else merging)
    episode = Episode(env, policy, seed)
    began = time.perf_counter()
    observations, _ = world.reset(seed=seed, options=None if options is None else dict(options))
    policy.reset(EpisodeTeam(env.engine), seed)
    with nullcontext() if raise_interrupt else PatientInterrupt() as interrupt:
        try:
            if on_decision is not None:
                on_decision(env)
            while env.agents and not (interrupt and interrupt.is_asked):
                decided = time.perf_counter()
                actions = policy.act(observations)
                episode.decision_seconds.append(time.perf_counter() - decided)
                observations = world.step(actions)[0]
                observations = {agent: observations[agent] for agent in env.agents}
                _show_decision(env, policy, on_decision)
        except KeyboardInterrupt:
            if interrupt is None or interrupt.is_asked:
                raise
            episode.is_interrupted = True
        episode.is_interrupted |= interrupt is not None and interrupt.is_asked and bool(env.agents)
    episode.wall_seconds = time.perf_counter() - began
    episode.given_up = list(policy.given_up)
    try:
        episode.report = policy.report()
    except Exception as error:  # of a policy of a user's own, anything; the episode is not lost
        episode.report_error = f"{type(error).__name__}: {error}"
    _note_merges(episode, world.events if isinstance(world, MergedMaps) else _merges_of(episode.report, env))
    return episode


def _note_merges(episode: Episode, merges: list[MergeEvent]) -> None:
    """Store the merges that were used, and notify the watchers."""
    env, episode.merges = episode.env, merges
    if isinstance(env, WatchedExploration):
        for merge in merges:
            env.note_event(merge_event(env, merge))


def _show_decision(
    env: ExplorationEnv,
    policy: Policy,
    on_decision: Progress | None,
) -> None:
    """Notify watchers and callbacks of a decision that has been carried out."""
    if isinstance(env, WatchedExploration):
        env.decided(None if env.driver is None else env.driver.orders(), policy.given_up)
    if on_decision is not None:
        on_decision(env)


def _merges_of(report: PolicyReport, env: ExplorationEnv) -> list[MergeEvent]:
    """Return the joins that a policy's decisions were based on, compared with the truth."""
    station = report.supervision
    used = [] if station is None else [join for join in station.joins if join.is_used]
    if not used:
        return []
    truth = true_frames(env)
    poses = [(join, join.found, truth[join.a, join.b]) for join in used]
    return [
        MergeEvent(
            join.time_s,
            join.a,
            join.b,
            (found.x, found.y, found.theta),
            (true.x, true.y, true.theta),
            join.at,
            join.is_direct,
        )
        for join, found, true in poses
    ]
