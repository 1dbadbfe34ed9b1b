"""Results of a run, as the dictionary of ``result.json``: its identity and metrics.

The format is in docs/reference/files.md.
"""

import json
import math
from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

import lidarium
from lidarium.agents.report import GivenUp, PolicyReport
from lidarium.envs.engine.tally import THRESHOLDS
from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.simulation.coverage import unpack_bits
from lidarium.envs.simulation.kernels.arrays import (
    BY_PERSON,
    BY_ROBOT,
    CLOSEST,
    CLOSEST_SPEED,
    NEAR_MISSES,
    NEAR_SPEED,
    NEAR_STEPS,
    YIELDED,
)
from lidarium.evaluation.episodes.events import in_floor_frame, operating_events
from lidarium.evaluation.episodes.history import WHOLE, History, Milestone
from lidarium.evaluation.episodes.runner import Episode
from lidarium.evaluation.episodes.settings_identity import realism_of, settings_sha256
from lidarium.evaluation.metrics import METRICS, Column, Direction, Metric
from lidarium.evaluation.metrics.cells import (
    free_coverage,
    free_error_rate,
    instant_overlap,
    known_coverage,
    occupied_f1,
    occupied_iou,
    overlap,
    overlap_of_maps,
    own_coverage,
    surface,
    valid_coverage,
)
from lidarium.evaluation.metrics.merges import Trajectories, merge_figures
from lidarium.evaluation.metrics.poses import absolute_error, relative_error
from lidarium.evaluation.metrics.progress import (
    area_under_curve,
    balance,
    collisions_per_km,
    decision_percentiles,
    decisions_to,
    distance_sum_to,
    distance_to,
    is_success,
    path_balance,
    peak_megabytes,
)
from lidarium.evaluation.truth.beliefs import free_as_held, maps_on_floor
from lidarium.evaluation.truth.true_map import Truth, left_by_failed, truth_of


class EpisodeData:
    """A finished or interrupted episode, as metrics read it.

    Attributes
    ----------
    env, settings, episode, history
        As above; the settings are those of the environment.
    robots : int
        Number of robots.
    lengths : (robots,) float64
        Length of each robot's path [m].
    """

    def __init__(self, env: ExplorationEnv, episode: Episode | None = None, history: History | None = None) -> None:
        self.env, self.settings, self.episode = env, env.settings, episode
        self.history = None if history is None or not history.has_begun else history
        self.robots = env.settings.robots
        self.lengths: NDArray[np.float64] = env.world.travelled

    @property
    def coverage(self) -> NDArray[np.float64]:
        """Coverage over time, (changes, 2): time [s], and the share of the floor sensed from then on."""
        return np.array(self.env.scorer.curve).reshape(-1, 2)

    @property
    def times(self) -> NDArray[np.float64]:
        """Times of ``poses``, (times,) [s]."""
        return np.array([time for time, _ in self.env.scorer.track], np.float64)

    @property
    def poses(self) -> NDArray[np.float64]:
        """True poses over time, (times, robots, 3): x, y, theta [m, m, rad]."""
        return np.stack([poses for _, poses in self.env.scorer.track])

    @property
    def collisions(self) -> int:
        """Number of contacts that began, all robots together."""
        return int(self.env.world.collisions.sum())

    @property
    def report(self) -> PolicyReport:
        """The policy's report."""
        return self.run.report

    @property
    def run(self) -> Episode:
        """The episode; a ValueError if the metrics were asked of an environment alone."""
        if self.episode is None:
            raise ValueError("this metric needs the whole episode; want EpisodeData(env, episode)")
        return self.episode

    @cached_property
    def truth(self) -> Truth:
        """Occupied, reachable and knowable cells of the floor, each (rows, columns) bool."""
        return truth_of(self.env)

    @cached_property
    def maps(self) -> NDArray[np.int8]:
        """Each robot's own map on the floor, (robots, rows, columns): log-odds, 0 is unknown."""
        return maps_on_floor(self.env)

    @cached_property
    def team_map(self) -> NDArray[np.int16]:
        """The sum of the robots' maps, (rows, columns): above 0 is occupied, below 0 is free."""
        return np.asarray(np.sum(self.maps, axis=0, dtype=np.int16))

    @cached_property
    def sensed(self) -> NDArray[np.bool_]:
        """Cells that the team's lasers have sensed, (rows, columns) bool."""
        return unpack_bits(self.env.score.team_masks[0], self.maps.shape[2])

    @cached_property
    def own_coverages(self) -> tuple[float, float]:
        """Minimum and mean of the robots' ``C_own``."""
        return own_coverage(free_as_held(self.env, self.maps), self.truth.counted)

    @cached_property
    def trajectories(self) -> Trajectories:
        """True and believed poses of the robots over time; needs a history."""
        assert self.history is not None
        times, poses = zip(*self.env.scorer.track, strict=True)
        # An interrupted step may have left one more of the one than of the other.
        known = min(len(poses), len(self.history.believed))
        return Trajectories(
            self.env.possible_agents,
            np.array(times[:known], np.float64),
            np.stack(poses[:known]),
            self.history.believed[:known],
        )

    def milestone(self, share: float) -> Milestone | None:
        """Return the step in which coverage first reached a threshold; None if it did not, or is unknown."""
        return None if self.history is None else self.history.milestone(share)


def result_of(episode: Episode, policy: str | None = None, history: History | None = None) -> dict[str, Any]:
    """Return the figures of a finished or interrupted episode as ``result.json`` has them.

    Times are simulated [s], lengths are in metres, positions of ``given_up`` in the floor's frame. Figures over
    time are None without a history. ``ended_because`` is None for robots that an interrupted run left at work. A
    ValueError if the episode was interrupted before it began. A metric that fails is None, and
    ``failed_metrics`` says why; it names ``report`` if that of the policy failed.
    """
    env, settings = episode.env, episode.env.settings
    if env.floor is None:
        raise ValueError("the episode was interrupted before it began, there is no result")
    data = EpisodeData(env, episode, history)
    figures, failed = _figures_or_errors(data)
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
        **figures,
        **({"failed_metrics": failed} if failed else {}),
        "version": lidarium.__version__,
        "floor_sha256": env.floor.sha256,
        "settings_sha256": settings_sha256(settings),
    }


def _figures_or_errors(data: EpisodeData) -> tuple[dict[str, Any], dict[str, str]]:
    """Return all metrics of an episode, and why some of them, which are None, failed: an episode is never lost."""
    figures: dict[str, Any] = {}
    failed = {"report": data.run.report_error} if data.run.report_error else {}
    for name in METRICS:
        try:
            made = figures_of(data, [name])
            json.dumps(made, allow_nan=False)  # nan, or what no file can hold
            figures |= made
        except Exception as error:  # of a metric of a user's own, anything
            figures[name] = None
            failed[name] = f"{type(error).__name__}: {error}"
    return figures, failed


def figures_of(data: EpisodeData, names: Iterable[str]) -> dict[str, Any]:
    """Return metrics of an episode by name, ready for JSON."""
    return {name: _plain(METRICS[name].of(data)) for name in names}


def _plain(value: Any) -> Any:  # noqa: ANN401
    """Return a value without types of NumPy, which JSON does not have."""
    return value.tolist() if isinstance(value, np.generic | np.ndarray) else value


_Value = Callable[[EpisodeData], Any]


def _add(
    name: str,
    of: _Value,
    summary: str,
    unit: str = "",
    direction: Direction = None,
    *,
    title: str | None = None,
    digits: int | None = None,
    columns: tuple[Column, ...] = (),
) -> None:
    """Register a metric of the package."""
    digits = (1 if unit in ("s", "m", "ms") else 3) if digits is None else digits
    made = Metric(name, title or name.replace("_", " "), unit, direction, summary, digits, of, columns)
    METRICS.register(name, made, summary)


def _rounded(value: float | None, digits: int) -> float | None:
    return None if value is None else round(value, digits)


def _time_to(data: EpisodeData, share: float) -> float | None:
    return _rounded(data.env.scorer.times.get(share), 6)


def _success(data: EpisodeData) -> bool:
    stop = THRESHOLDS[-1] if data.settings.stop_coverage is None else data.settings.stop_coverage
    times, coverage = data.coverage.T
    return is_success(times, coverage, stop, _horizon(data))


def _area(data: EpisodeData) -> float | None:
    horizon, (times, coverage) = _horizon(data), data.coverage.T
    return None if horizon is None else round(area_under_curve(times, coverage, horizon), 9)


def _horizon(data: EpisodeData) -> float | None:
    steps = data.settings.horizon_steps
    return None if steps is None else steps * data.settings.time_step


def _at_threshold(data: EpisodeData, share: float, figure: str) -> float | int | None:
    """Return the longest path, the sum of paths or the decisions until a threshold of coverage."""
    milestones = [] if data.history is None else data.history.milestones
    coverage = [milestone.coverage for milestone in milestones]
    if figure == "decisions":
        return decisions_to([milestone.decisions for milestone in milestones], coverage, share)
    lengths = np.array([milestone.lengths for milestone in milestones])
    return _rounded((distance_to if figure == "longest" else distance_sum_to)(lengths, coverage, share), 9)


def _overlap_of_maps(data: EpisodeData) -> float | None:
    whole = data.milestone(WHOLE)
    return None if whole is None or whole.known_shares is None else round(overlap_of_maps(whole.known_shares), 9)


def _overlap_at(data: EpisodeData, share: float) -> float | None:
    milestone = data.milestone(share)
    return None if milestone is None else round(milestone.overlap, 9)


def _instant_overlap(data: EpisodeData) -> float | None:
    if data.history is None:
        return None
    curves = data.history.curves
    return round(instant_overlap(curves.seen_once, curves.seen_twice), 9)


def _given_up(data: EpisodeData) -> list[dict[str, Any]]:
    def entry(given_up: GivenUp) -> dict[str, Any]:
        x, y = in_floor_frame(data.env, given_up.agent, given_up.x, given_up.y)
        return {
            "agent": given_up.agent,
            "x": round(x, 4),
            "y": round(y, 4),
            "size_m": round(given_up.size_m, 4),
            "reason": given_up.reason,
        }

    return [entry(given_up) for given_up in data.run.given_up]


def _absolute_errors(data: EpisodeData) -> list[float] | None:
    """Return the ATE of each robot; the best fit brings frames together if starts are unknown."""
    if data.history is None:
        # True localization has no error.
        return [0.0] * data.robots if data.settings.localization == "truth" else None
    poses = data.trajectories
    return [
        round(absolute_error(poses.believed[:, robot], poses.true[:, robot], not data.settings.known_starts), 9)
        for robot in range(data.robots)
    ]


def _relative_errors(data: EpisodeData, part: int) -> list[float | None] | None:
    """Return the RPE over 1 s of each robot: of translations (part 0), or of rotations (part 1)."""
    if data.history is None:
        return None
    poses = data.trajectories
    times = poses.times
    steps = max(round(1.0 / (times[1] - times[0])), 1) if len(times) > 1 else 1
    errors = [relative_error(poses.believed[:, robot], poses.true[:, robot], steps) for robot in range(data.robots)]
    return [None if error is None else round(error[part], 9) for error in errors]


def _among_people(data: EpisodeData, column: int) -> float | int | None:
    """Return a figure of the robots' safety among people."""
    if data.settings.people == 0:
        return None
    safety, step_s = data.env.simulation.safety, data.settings.time_step
    if column in (CLOSEST, CLOSEST_SPEED):
        nearest = safety[int(np.argmin(safety[:, CLOSEST]))]
        return round(float(nearest[column]), 9) if np.isfinite(nearest[CLOSEST]) else None
    if column == NEAR_SPEED:
        return round(float(safety[:, column].max()), 9)
    total = float(safety[:, column].sum())
    return round(total * step_s, 6) if column in (NEAR_STEPS, YIELDED) else int(total)


def _known(data: EpisodeData) -> NDArray[np.bool_]:
    return np.asarray((data.maps != 0).any(axis=0))


def _others_coverage(data: EpisodeData) -> float | None:
    """Return the coverage by robots that have not failed, of the floor still in their reach."""
    left = left_by_failed(data.env)
    if left is None:
        return None
    seen = [
        unpack_bits(mask, left.shape[1])
        for mask, failed in zip(data.env.score.masks, data.env.world.failed, strict=True)
        if not failed
    ]
    return round(free_coverage(np.any(seen, axis=0), left), 9)


def _f1(data: EpisodeData) -> float:
    wanted = surface(data.truth.occupied, data.sensed)
    return round(occupied_f1(data.team_map > 0, data.truth.occupied, wanted=wanted), 9)


def _energy(data: EpisodeData) -> list[float] | None:
    return [round(float(used), 6) for used in data.env.energy_j] if data.settings.battery.is_limited else None


def _merges(data: EpisodeData) -> dict[str, Any]:
    trajectories = None
    if data.history is not None:
        # If starts are known, robots believe poses on the floor; those of merges are of the robots' maps.
        offsets = np.zeros((data.robots, 3))
        offsets[:, :2] = data.env.perception.poses.offsets
        trajectories = replace(data.trajectories, believed=data.trajectories.believed - offsets)
    return merge_figures(data.run.merges, data.settings.occupancy.resolution, trajectories)


def _tick_ms(data: EpisodeData) -> dict[str, float | None] | None:
    """Return percentiles of the station's decisions, and of its merges; None without a station."""
    station = data.report.supervision
    if station is None:
        return None
    ticks, merges = map(decision_percentiles, (station.tick_seconds, station.merge_seconds))
    return {**ticks, **{f"merge_{name}": value for name, value in merges.items()}}


def _steps_per_s(data: EpisodeData) -> float | None:
    steps, seconds = max(int(data.env.world.steps[0]), 0), data.run.wall_seconds
    return round(steps / seconds, 3) if seconds > 0.0 else None


_PERCENT = {share: round(100 * share) for share in THRESHOLDS}

_add(
    "coverage_final",
    lambda data: round(data.env.scorer.coverage, 9),
    "share of the floor (`C_free`) that the team sensed",
    direction="higher",
    columns=(
        Column(
            "coverage_percent",
            "coverage at the end",
            "%",
            "higher",
            of=lambda share: 100.0 * share,
            by_mean=True,
            is_compared=True,
            bounds=(0.0, 100.0),
        ),
    ),
)
_add("time_s", lambda data: round(data.env.scorer.time, 6), "simulated time of the episode", "s")
for _share, _name in _PERCENT.items():
    _add(
        f"t{_name}_s",
        partial(_time_to, share=_share),
        f"time to {_name} % coverage",
        "s",
        "lower",
        title=f"time to {_name} %",
    )
_add(
    "success",
    _success,
    "whether the coverage that ends a run was reached within the horizon",
    direction="higher",
)
_add("auc", _area, "mean coverage from the start to the horizon", direction="higher")
for _figure, _key, _text in (
    ("longest", "d{}_m", "longest path of a robot at {} % coverage"),
    ("sum", "d_sum{}_m", "sum of the robots' paths at {} % coverage"),
    ("decisions", "n{}", "number of decisions until {} % coverage"),
):
    for _share, _name in _PERCENT.items():
        _add(
            _key.format(_name),
            partial(_at_threshold, share=_share, figure=_figure),
            _text.format(_name),
            "" if _figure == "decisions" else "m",
            "lower",
        )
_add(
    "path_m",
    lambda data: [round(float(length), 9) for length in data.lengths],
    "length of each robot's path",
    "m",
    "lower",
    columns=(
        Column(
            "path_m",
            "path of the team",
            "m",
            "lower",
            of=lambda paths: float(sum(paths)),
            is_compared=True,
            bounds=(0.0, math.inf),
        ),
        Column(
            "longest_path_m",
            "longest path of a robot",
            "m",
            "lower",
            of=lambda paths: float(max(paths)),
            is_main=False,
            bounds=(0.0, math.inf),
        ),
    ),
)
_add(
    "path_balance",
    lambda data: round(path_balance(data.lengths), 9),
    "standard deviation of the paths' lengths over their mean",
    direction="lower",
)
_add(
    "overlap",
    lambda data: round(overlap(data.env.score.masks), 9),
    "share of the sensed cells that two or more robots sensed",
    direction="lower",
    columns=(
        Column(
            "overlap_percent",
            "overlap",
            "%",
            "lower",
            of=lambda share: 100.0 * share,
            is_compared=True,
            bounds=(0.0, 100.0),
        ),
    ),
)
_add(
    "overlap_eb",
    _overlap_of_maps,
    "sum of the robots' `C_known`, minus 1, at 99 % (Explore-Bench)",
    "",
    "lower",
)
for _share in (0.85, 0.95):
    _name = round(100 * _share)
    _add(
        f"overlap_mx_{_name}",
        partial(_overlap_at, share=_share),
        f"`overlap` at {_name} % (MAexp)",
        "",
        "lower",
    )
_add(
    "overlap_mv",
    _instant_overlap,
    "mean share of footprints seen by two or more at once (MARVEL)",
    "",
    "lower",
)
_add(
    "collisions",
    lambda data: data.collisions,
    "number of contacts that began",
    direction="lower",
    columns=(Column("collisions", "collisions", "", "lower", 2, by_mean=True, is_main=False, bounds=(0.0, math.inf)),),
)
_add(
    "collisions_per_km",
    lambda data: _rounded(collisions_per_km(data.collisions, data.lengths), 6),
    "collisions per kilometre driven",
    "1/km",
    "lower",
)
_SAFETY: tuple[tuple[str, int, str, str, Direction], ...] = (
    ("closest_approach_m", CLOSEST, "smallest gap between a robot and a person", "m", "higher"),
    ("speed_at_closest_m_s", CLOSEST_SPEED, "speed of the robot at `closest_approach_m`", "m/s", "lower"),
    ("near_misses", NEAR_MISSES, "how often a gap to a person fell below 0.5 m", "", "lower"),
    ("time_near_people_s", NEAR_STEPS, "time with a gap to a person below 0.5 m, summed over robots", "s", "lower"),
    ("speed_near_people_m_s", NEAR_SPEED, "maximum speed of a robot in that time", "m/s", "lower"),
    ("contacts_by_robot", BY_ROBOT, "contacts of a robot that drove into a person", "", "lower"),
    ("contacts_by_person", BY_PERSON, "contacts of a person who walked into a robot", "", "lower"),
    ("yielding_s", YIELDED, "time that robots lost by slowing down for people, summed", "s", "lower"),
)
for _key, _column, _text, _unit, _direction in _SAFETY:
    _add(_key, partial(_among_people, column=_column), f"{_text}; null without people", _unit, _direction)
_add(
    "ended_because",
    lambda data: {agent: data.env.scorer.ended_because.get(agent) for agent in data.env.possible_agents},
    "reason why each robot ended; null if it was still at work",
)
_add("given_up", _given_up, "frontiers that the policy left unexplored, with position, size and reason")
_add(
    "decided_by",
    lambda data: dict(data.report.decided_by) or None,
    "number of decisions by each rule of the policy",
)
_add("ate_m", _absolute_errors, "absolute trajectory error of each robot", "m", "lower")
_add(
    "rpe_m",
    partial(_relative_errors, part=0),
    "relative error of each robot's translation over 1 s",
    "m",
    "lower",
)
_add(
    "rpe_rad",
    partial(_relative_errors, part=1),
    "relative error of each robot's rotation over 1 s",
    "rad",
    "lower",
)
_add(
    "c_known_final",
    lambda data: round(known_coverage(_known(data), data.truth.knowable), 9),
    "`C_known` of the team's map",
    direction="higher",
)
_add(
    "c_valid_final",
    lambda data: round(valid_coverage(_known(data), data.truth.counted, data.truth.occupied), 9),
    "`C_valid` of the team's map",
    direction="higher",
)
_add(
    "c_own_min_final",
    lambda data: round(data.own_coverages[0], 9),
    "minimum of the robots' `C_own`",
    direction="higher",
)
_add(
    "c_own_mean_final",
    lambda data: round(data.own_coverages[1], 9),
    "mean of the robots' `C_own`",
    direction="higher",
)
_add(
    "c_others_final",
    _others_coverage,
    "coverage, by the robots that have not failed, of the floor that they can still reach; null if none has failed",
    direction="higher",
)
_add(
    "balance",
    lambda data: round(balance([known_coverage(own != 0, data.truth.knowable) for own in data.maps]), 9),
    "standard deviation of the robots' `C_known` (Explore-Bench)",
    direction="lower",
)
_add(
    "iou_occupied",
    lambda data: round(occupied_iou(data.team_map > 0, data.truth.occupied, data.sensed), 9),
    "intersection over union of occupied cells, within one cell",
    direction="higher",
)
_add("f1_occupied", _f1, "F1 of occupied cells, within one cell", direction="higher")
_add(
    "free_error_rate",
    lambda data: round(free_error_rate(data.team_map < 0, data.truth.occupied), 9),
    "share of the cells believed free that are occupied",
    direction="lower",
)
_add("energy_j", _energy, "energy that each robot used; null without batteries", "J", "lower")
_add(
    "operating",
    lambda data: operating_events(data.env),
    "changes of the robots' operating states, and orders",
)
_add("merges", _merges, "number and errors of merges of maps")
_add(
    "supervisor",
    lambda data: None if data.report.supervision is None else data.report.supervision.figures,
    "counts of the station's decisions; null without a station",
)
_add(
    "decision_ms",
    lambda data: decision_percentiles(data.run.decision_seconds),
    "median and 95th percentile of the wall time of decisions",
    "ms",
    "lower",
)
_add("tick_ms", _tick_ms, "the same of the station's decisions and merges", "ms", "lower")
_add("peak_mb", lambda _: _rounded(peak_megabytes(), 1), "peak memory of the process", "MB", "lower")
_add("steps_per_s", _steps_per_s, "simulated time steps per second of wall time", "1/s", "higher", digits=1)
