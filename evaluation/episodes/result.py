"""Results of a run, as the dictionary of ``result.json``.

The format is in docs/reference/files.md.
"""

from typing import Any

import numpy as np

import lidarium
from lidarium.agents.report import GivenUp
from lidarium.envs.engine.tally import THRESHOLDS
from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.simulation.coverage import unpack_bits
from lidarium.evaluation import metrics
from lidarium.evaluation.episodes.events import in_floor_frame, operating_events
from lidarium.evaluation.episodes.history import WHOLE, History
from lidarium.evaluation.episodes.runner import Episode
from lidarium.evaluation.episodes.settings_identity import realism_of, settings_sha256
from lidarium.evaluation.episodes.supervision import tick_percentiles
from lidarium.evaluation.metrics.merges import Trajectories, merge_figures
from lidarium.evaluation.truth.beliefs import free_as_held, maps_on_floor
from lidarium.evaluation.truth.true_map import left_by_failed, truth_of


def result_of(episode: Episode, policy: str | None = None, history: History | None = None) -> dict[str, Any]:
    """Return the figures of an episode as ``result.json`` has them.

    The episode is finished or interrupted.

    Parameters
    ----------
    episode : Episode
        What `run_episode` left; its environment must have been reset.
    policy : str or None
        Name of the policy; that of its class where None.
    history : History or None
        What watched the episode; where None, the figures over time that need one are None.

    Returns
    -------
    dict
        Ready for JSON. Times are simulated [s], lengths in metres; positions of ``given_up`` are in the
        floor's frame. ``ended_because`` is None for robots that an interrupted run left at work.

    Raises
    ------
    ValueError
        Where the episode was interrupted before it began.
    """
    env, settings, scorer, world = episode.env, episode.env.settings, episode.env.scorer, episode.env.world
    if env.floor is None:
        raise ValueError("the episode was interrupted before it began, there is no result")
    if history is not None and not history.has_begun:
        history = None
    steps, report = max(int(world.steps[0]), 0), episode.policy.report()
    collisions = int(world.collisions.sum())
    return {
        "floor": env.floor.name,
        "robots": settings.robots,
        "policy": policy or type(episode.policy).__name__,
        "backend": settings.backend,
        "localization": settings.localization,
        "realism": realism_of(settings),
        "seed": episode.seed,
        "horizon_s": settings.horizon_s,
        "interrupted": episode.is_interrupted,
        "coverage_final": round(scorer.coverage, 9),
        "time_s": round(scorer.time, 6),
        **{f"t{round(100 * share)}_s": _rounded(scorer.times.get(share), 6) for share in THRESHOLDS},
        **_success(env),
        **_at_thresholds(history),
        "path_m": [round(float(length), 9) for length in world.travelled],
        "path_balance": round(metrics.path_balance(world.travelled), 9),
        "overlap": round(metrics.overlap(env.score.masks), 9),
        **_overlaps(history),
        "collisions": collisions,
        "collisions_per_km": _rounded(metrics.collisions_per_km(collisions, world.travelled), 6),
        "ended_because": {agent: scorer.ended_because.get(agent) for agent in env.possible_agents},
        "given_up": [_entry(env, given_up) for given_up in episode.given_up],
        "decided_by": dict(report.decided_by) or None,
        **_pose_errors(env, history),
        **map_figures(env),
        "energy_j": [round(float(used), 6) for used in env.energy_j] if settings.battery.is_limited else None,
        "operating": operating_events(env),
        "merges": merge_figures(
            episode.merges,
            settings.occupancy.resolution,
            None if history is None else _trajectories(env, history),
        ),
        "supervisor": None if report.supervision is None else report.supervision.figures,
        "decision_ms": metrics.decision_percentiles(episode.decision_seconds),
        "tick_ms": tick_percentiles(report),
        "peak_mb": _rounded(metrics.peak_megabytes(), 1),
        "steps_per_s": round(steps / episode.wall_seconds, 3) if episode.wall_seconds > 0.0 else None,
        "version": lidarium.__version__,
        "floor_sha256": env.floor.sha256,
        "settings_sha256": settings_sha256(settings),
    }


def _success(env: ExplorationEnv) -> dict[str, Any]:
    """Return whether the run reached what stops it, and its coverage area.

    The area is that under its curve of coverage.
    """
    settings = env.settings
    times, coverage = np.array(env.scorer.curve).reshape(-1, 2).T
    stop = THRESHOLDS[-1] if settings.stop_coverage is None else settings.stop_coverage
    horizon = None if settings.horizon_steps is None else settings.horizon_steps * settings.time_step
    return {
        "success": metrics.is_success(times, coverage, stop, horizon),
        "auc": None if horizon is None else round(metrics.area_under_curve(times, coverage, horizon), 9),
    }


def _at_thresholds(history: History | None) -> dict[str, Any]:
    """Return ways and decisions until each threshold of coverage."""
    milestones = [] if history is None else history.milestones
    coverage = [milestone.coverage for milestone in milestones]
    lengths = np.array([milestone.lengths for milestone in milestones])
    decisions = [milestone.decisions for milestone in milestones]
    names = {share: str(round(100 * share)) for share in THRESHOLDS}
    return {
        **{
            f"d{name}_m": _rounded(metrics.distance_to(lengths, coverage, share), 9)
            for share, name in names.items()
        },
        **{
            f"d_sum{name}_m": _rounded(metrics.distance_sum_to(lengths, coverage, share), 9)
            for share, name in names.items()
        },
        **{f"n{name}": metrics.decisions_to(decisions, coverage, share) for share, name in names.items()},
    }


def _overlaps(history: History | None) -> dict[str, Any]:
    """Return the overlaps as the reference projects take them, each when they take it."""
    nearly, mostly, whole = (
        None if history is None else history.milestone(share) for share in (0.85, 0.95, WHOLE)
    )
    curves = None if history is None else history.curves
    return {
        "overlap_eb": None
        if whole is None or whole.known_shares is None
        else round(metrics.overlap_of_maps(whole.known_shares), 9),
        "overlap_mx_85": None if nearly is None else round(nearly.overlap, 9),
        "overlap_mx_95": None if mostly is None else round(mostly.overlap, 9),
        "overlap_mv": None
        if curves is None
        else round(metrics.instant_overlap(curves.seen_once, curves.seen_twice), 9),
    }


def _pose_errors(env: ExplorationEnv, history: History | None) -> dict[str, Any]:
    """Return ATE and RPE of each robot.

    Frames agree where starts are known, else the best fit brings them together.
    """
    robots = env.settings.robots
    if history is None and env.settings.localization != "truth":
        return {"ate_m": None, "rpe_m": None, "rpe_rad": None}
    if history is None:
        # The localizer is the truth: no error.
        return {"ate_m": [0.0] * robots, "rpe_m": None, "rpe_rad": None}
    trajectories = _trajectories(env, history)
    times, true, believed = trajectories.times, trajectories.true, trajectories.believed
    steps = max(round(1.0 / (times[1] - times[0])), 1) if len(times) > 1 else 1
    relative = [metrics.relative_error(believed[:, robot], true[:, robot], steps) for robot in range(robots)]
    return {
        "ate_m": [
            round(
                metrics.absolute_error(believed[:, robot], true[:, robot], not env.settings.known_starts), 9
            )
            for robot in range(robots)
        ],
        "rpe_m": [None if error is None else round(error[0], 9) for error in relative],
        "rpe_rad": [None if error is None else round(error[1], 9) for error in relative],
    }


def _trajectories(env: ExplorationEnv, history: History) -> Trajectories:
    """Return where the robots were and believed to be."""
    times, poses = zip(*env.scorer.track, strict=True)
    # An interrupted step may have left one more of the one than of the other.
    known = min(len(poses), len(history.believed))
    return Trajectories(
        env.possible_agents,
        np.array(times[:known], np.float64),
        np.stack(poses[:known]),
        history.believed[:known],
    )


def map_figures(env: ExplorationEnv) -> dict[str, Any]:
    """Return the known share of the floor, and how well maps agree with the truth.

    Both are those of the maps in the end.
    """
    truth, maps = truth_of(env), maps_on_floor(env)
    team = np.sum(maps, axis=0, dtype=np.int16)
    known, believed, believed_free = (
        np.asarray(cells) for cells in ((maps != 0).any(axis=0), team > 0, team < 0)
    )
    sensed = unpack_bits(env.score.team_masks[0], maps.shape[2])
    own_least, own_mean = metrics.own_coverage(free_as_held(env, maps), truth.counted)
    return {
        "c_known_final": round(metrics.known_coverage(known, truth.knowable), 9),
        "c_valid_final": round(metrics.valid_coverage(known, truth.counted, truth.occupied), 9),
        "c_own_min_final": round(own_least, 9),
        "c_own_mean_final": round(own_mean, 9),
        "c_others_final": _rounded(others_coverage(env), 9),
        "balance": round(
            metrics.balance([metrics.known_coverage(own != 0, truth.knowable) for own in maps]), 9
        ),
        "iou_occupied": round(metrics.occupied_iou(believed, truth.occupied, sensed), 9),
        "f1_occupied": round(
            metrics.occupied_f1(believed, truth.occupied, wanted=metrics.surface(truth.occupied, sensed)), 9
        ),
        "free_error_rate": round(metrics.free_error_rate(believed_free, truth.occupied), 9),
    }


def others_coverage(env: ExplorationEnv) -> float | None:
    """Return the share of the reachable floor sensed by robots that have not failed.

    Reachable is what the bodies of the failed ones leave in reach. None where no robot has failed, or all
    have.
    """
    left = left_by_failed(env)
    if left is None:
        return None
    seen = [
        unpack_bits(mask, left.shape[1])
        for mask, failed in zip(env.score.masks, env.world.failed, strict=True)
        if not failed
    ]
    return metrics.free_coverage(np.any(seen, axis=0), left)


def _entry(env: ExplorationEnv, given_up: GivenUp) -> dict[str, Any]:
    x, y = in_floor_frame(env, given_up.agent, given_up.x, given_up.y)
    return {
        "agent": given_up.agent,
        "x": round(x, 4),
        "y": round(y, 4),
        "size_m": round(given_up.size_m, 4),
        "reason": given_up.reason,
    }


def _rounded(value: float | None, digits: int) -> float | None:
    return None if value is None else round(value, digits)
