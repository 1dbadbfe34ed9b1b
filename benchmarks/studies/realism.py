"""The study ``realism``: how well robots know where they are with noise, wheels that slip, and SLAM."""

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import lidarium
from lidarium.benchmarks.studies.shared.study import Progress, Study, Task, do_missing, kept_lines
from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.settings.making import make_settings
from lidarium.envs.simulation.coverage import unpack_bits
from lidarium.evaluation.episodes.history import History
from lidarium.evaluation.episodes.result import result_of
from lidarium.evaluation.episodes.runner import run_episode
from lidarium.evaluation.episodes.watching import WatchedExploration, Watcher
from lidarium.evaluation.metrics.cells import occupied_iou
from lidarium.evaluation.metrics.poses import absolute_error, best_transform
from lidarium.evaluation.truth.beliefs import team_log_odds
from lidarium.evaluation.truth.true_map import truth_of
from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.localization.localizer import KeyScans, Localizer, Sensing

TEAM = 5
"""Robots of the team whose speed is measured."""

TEAM_HORIZON_S = 120.0
HORIZON_S = 600.0
"""Longest episode [s]."""

REPEATS = 5
"""Runs of an episode with a long correction, as the machine does other work too."""


@dataclass(frozen=True, slots=True)
class Run(Task):
    """A floor that a number of robots explore from a seed."""

    floor: str
    robots: int
    seed: int

    @property
    def key(self) -> str:
        """Name that no other one of its file has."""
        return f"{Path(self.floor).name.partition('.')[0]} | {self.robots} | seed {self.seed}"


class TimedLocalizer:
    """A localizer that notes how long each scan takes it."""

    def __init__(self, localizer: Localizer, seconds: list[tuple[float, bool]]) -> None:
        self._localizer, self._seconds = localizer, seconds

    @property
    def covariance(self) -> NDArray[np.float64]:
        """That of the localizer."""
        return self._localizer.covariance

    def reset(self, pose: NDArray[np.float64], seed: int) -> None:
        """Begin the localizer again."""
        self._localizer.reset(pose, seed)

    def localize(self, sensing: Sensing) -> NDArray[np.float64]:
        """Time what the localizer does with a scan."""
        began = time.perf_counter()
        pose = self._localizer.localize(sensing)
        self._seconds.append((time.perf_counter() - began, False))
        return pose

    def take_correction(self) -> KeyScans | None:
        """Note whether the scan before corrected the past."""
        began = time.perf_counter()
        correction = self._localizer.take_correction()
        if correction is not None:
            self._seconds[-1] = (self._seconds[-1][0] + time.perf_counter() - began, True)
        return correction


class Watch(Watcher):
    """Watches how long scans take localizers, and where wheels would place robots.

    `seconds`: wall time of each scan [s], and whether it corrected the past; `wheels`: how far dead reckoning is off
    after each step [m]; `believed`, `true`: poses after each step [m, m, rad].
    """

    def begin(self, env: ExplorationEnv) -> None:
        """Begin a new episode."""
        self.seconds: list[tuple[float, bool]] = []
        self.wheels: list[NDArray[np.float64]] = []
        self.believed: list[NDArray[np.float64]] = []
        self.true: list[NDArray[np.float64]] = []
        localizers = env.perception.poses.localizers
        localizers[:] = [
            None if localizer is None else TimedLocalizer(localizer, self.seconds) for localizer in localizers
        ]
        render = env.simulation.render_again

        def render_timed(row: int, poses: NDArray[np.float64], ranges: NDArray[np.float32]) -> None:
            began = time.perf_counter()
            render(row, poses, ranges)
            self.seconds[-1] = (self.seconds[-1][0] + time.perf_counter() - began, True)

        env.simulation.render_again = render_timed  # type: ignore[method-assign]

    def step(self, env: ExplorationEnv, _commands: NDArray[np.float64]) -> None:
        """Note how far dead reckoning is off, and where robots are and believe to be."""
        world = env.world
        cosine, sine = np.cos(world.starts[:, 2]), np.sin(world.starts[:, 2])
        x, y = env.simulation.odometry[:, 0], env.simulation.odometry[:, 1]
        reckoned = world.starts[:, :2] + np.stack([cosine * x - sine * y, sine * x + cosine * y], axis=1)
        self.wheels.append(np.hypot(*(reckoned - world.poses[:, :2]).T))
        self.believed.append(env.beliefs.believed.copy())
        self.true.append(world.poses.copy())

    def outcome(self, env: ExplorationEnv) -> None:
        """Nothing has to be noted here."""


def measure_run(run: Run) -> dict[str, Any]:
    """Run one episode, and for the first seed one with true poses."""
    measured = episode(run)
    if run.seed == 0:
        measured["true_iou"] = true_iou(run)
    return measured


def episode(run: Run) -> dict[str, Any]:
    """Run one episode; return what is measured of it."""
    history, watch, robots = History(), Watch(), run.robots
    settings = make_settings(robots=robots, realism="lab", horizon_s=HORIZON_S, resolution=0.05)
    env = WatchedExploration(run.floor, settings, watchers=[history, watch])
    result = result_of(
        run_episode(lidarium.policy("nearest_frontier"), env, seed=run.seed), "nearest_frontier", history
    )
    believed, true = np.array(watch.believed), np.array(watch.true)
    aligned = [absolute_error(believed[:, robot], true[:, robot]) for robot in range(robots)]
    last = np.hypot(*(env.beliefs.believed - env.world.poses)[:, :2].T)
    return {
        "floor": result["floor"],
        "spec": run.floor,
        "robots": robots,
        "seed": run.seed,
        "time_s": result["time_s"],
        "coverage": result["coverage_final"],
        "way_m": result["path_m"],
        "ate_m": result["ate_m"],
        "aligned_m": aligned,
        "last_m": last.tolist(),
        "wheels_m": np.sqrt(np.mean(np.square(watch.wheels), axis=0)).tolist(),
        "seconds": watch.seconds,
        "iou": result["iou_occupied"],
        "aligned_iou": aligned_iou(env, believed.reshape(-1, 3), true.reshape(-1, 3)),
    }


def true_iou(run: Run) -> float:
    """Return IoU of the team's map in the same episode with true poses."""
    settings = make_settings(
        robots=run.robots, realism="lab", localization="truth", horizon_s=HORIZON_S, resolution=0.05
    )
    env = ExplorationEnv(run.floor, settings)
    ended = run_episode(lidarium.policy("nearest_frontier"), env, seed=run.seed)
    return float(result_of(ended, "nearest_frontier")["iou_occupied"])


def aligned_iou(env: ExplorationEnv, believed: NDArray[np.float64], true: NDArray[np.float64]) -> float:
    """Return IoU of the team's map after the best rigid motion.

    That is the motion of all believed poses (poses, 3) onto the true ones.
    """
    log_odds, origin = team_log_odds(env)
    truth, resolution = truth_of(env), env.settings.occupancy.resolution
    there = Transform(*best_transform(believed, true).tolist()).inverse()
    rows, columns = np.indices(log_odds.shape)
    centres = np.stack([columns, rows], axis=-1) * resolution + 0.5 * resolution + np.array(origin)
    cells = (
        np.floor((there.apply(centres.reshape(-1, 2)) - origin) / resolution).astype(np.int64).reshape(centres.shape)
    )
    is_inside = ((cells >= 0) & (cells < log_odds.shape[::-1])).all(axis=-1)
    laid = np.zeros(log_odds.shape, np.bool_)
    laid[is_inside] = log_odds[cells[is_inside, 1], cells[is_inside, 0]] > 0
    return occupied_iou(laid, truth.occupied, unpack_bits(env.score.team_masks[0], log_odds.shape[1]))


def corrections_of(measured: dict[str, Any]) -> NDArray[np.float64]:
    """Return how long the corrections of an episode's past took [s]."""
    return np.array([seconds for seconds, is_corrected in measured["seconds"] if is_corrected] or [np.nan])


def repeated_correction(run: Run) -> dict[str, Any]:
    """Return how long the longest correction of an episode takes [s].

    Each correction is the median over repeats of the episode, which are equal to the bit.
    """
    again = [episode(run) for _ in range(REPEATS)]
    longest = np.median([corrections_of(repeat) for repeat in again], axis=0).max()
    return {"longest_s": float(longest) if np.isfinite(longest) else None}


def team_rates(seeds: int) -> list[float]:
    """Return the agent steps a second of five robots on one core.

    Episodes take two minutes; `nearest_frontier` is included.
    """
    rates = []
    # The first episode may compile.
    for seed in range(-1, seeds):
        settings = make_settings(
            robots=TEAM, realism="lab", horizon_s=TEAM_HORIZON_S, resolution=0.05, stop_coverage=None
        )
        env = ExplorationEnv("building:17", settings)
        run = run_episode(lidarium.policy("nearest_frontier"), env, seed=max(seed, 0))
        rates.append(int(env.world.steps[0]) * TEAM / run.wall_seconds)
    return rates[1:]


FLOORS = ("apartment", "clinic", "building:17", "building:23", "office:15", "office:4")
"""Floors of 50 to 430 m2."""

LARGE_OFFICE = Path("floorplans/kth/xml/A0043011__0510035741_A_40_1_104.xml.gz")
"""An office of 2,000 m2, below the folder of real data."""

TEAMS = (1, 3)
SEEDS = range(5)
REPEATED = 3
"""So many episodes with the longest corrections of the past run several times."""

RATES_FILE, EPISODES_FILE, LONGEST_FILE = "rates.jsonl", "episodes.jsonl", "longest.jsonl"

ABOUT = """\
World of `realism="lab"`: datasheet noise, typical odometry (5 % bias), SLAM; `nearest_frontier`, cells of 0.05 m.
Medians over robots and seeds, in parentheses the worst. ATE is the root mean square of the online pose errors over
the whole episode, after the best rigid motion (Umeyama without scale), as in `evo`; *in the frame of the start* is
without that motion. IoU is of the team's map, as [metrics](../reference/metrics.md) defines it, *aligned* after the
best motion of all believed poses onto the true ones. *True poses* is the IoU of robots that know their poses, with
the same noise, in an episode of the first seed.

Targets: ATE of at most 0.05 m in an apartment of 65 m2 and 0.15 m in an office of 2,000 m2, IoU of at least 0.85, at
most 4 ms for a matched scan and 50 ms for a closure, and 600 agent steps a second. In the large office robots start in
a hall of which a laser of 5.6 m sees little, and drive along bare corridors. A map that is turned by one degree is two
cells off after 6 m."""

HEADER = (
    "floor",
    "robots",
    "way [m]",
    "coverage",
    "ATE [m]",
    "ATE in the frame of the start [m]",
    "last pose [m]",
    "wheels alone, ATE [m]",
    "IoU occupied",
    "IoU, aligned",
    "IoU, true poses",
)


@dataclass(frozen=True, slots=True)
class Rates(Task):
    """Speed of a team, in an episode of each seed."""

    seeds: int


def work(folder: Path, data: Path | None, every: int, _workers: int) -> Progress:
    """Measure every N-th pair of floor and team with all seeds. All is done in this process, as scans are timed."""
    floors = FLOORS if data is None else (*FLOORS, str(_large_office(data)))
    teams = [(floor, robots) for floor in floors for robots in TEAMS][::every]
    runs = [Run(floor, robots, seed) for floor, robots in teams for seed in SEEDS]
    rates = [Rates(len(SEEDS))]
    yield from do_missing(folder / RATES_FILE, "speed of a team", rates, _measure_rates, 1)
    yield from do_missing(folder / EPISODES_FILE, "episodes", runs, measure_run, 1)
    longest = longest_runs(kept_lines(folder / EPISODES_FILE))
    yield from do_missing(folder / LONGEST_FILE, "longest corrections", longest, repeated_correction, 1)


def _large_office(data: Path) -> Path:
    path = Path(data) / LARGE_OFFICE
    if not path.is_file():
        raise FileNotFoundError(f"no floor {path}; want the folder floorplans there")
    return path


def _measure_rates(task: Rates) -> dict[str, Any]:
    return {"rates": team_rates(task.seeds)}


def longest_runs(episodes: Sequence[dict[str, Any]]) -> list[Run]:
    """Return the runs in which the past took longest to correct."""
    ordered = sorted(episodes, key=lambda one: -float(np.nan_to_num(corrections_of(one)).max()))
    return [Run(one["spec"], one["robots"], one["seed"]) for one in ordered[:REPEATED]]


def rows_of(episodes: list[dict[str, Any]]) -> Iterator[str]:
    """Return a line for each floor and size of team: medians, and the worst."""
    for key in dict.fromkeys((one["floor"], one["robots"]) for one in episodes):
        own = [one for one in episodes if (one["floor"], one["robots"]) == key]
        names = ("ate_m", "aligned_m", "last_m", "wheels_m", "way_m")
        ate, aligned, last, wheels, way = (np.concatenate([one[name] for one in own]) for name in names)
        coverage, iou, fitted = (np.array([one[name] for one in own]) for name in ("coverage", "iou", "aligned_iou"))
        yield (
            f"| {key[0]} | {key[1]} | {np.median(way):.0f} | {np.median(coverage):.3f} | {np.median(aligned):.3f} "
            f"({aligned.max():.3f}) | {np.median(ate):.3f} ({ate.max():.3f}) | {np.median(last):.3f} "
            f"({last.max():.3f}) | {np.median(wheels):.2f} | {np.median(iou):.3f} ({iou.min():.3f}) | "
            f"{np.median(fitted):.3f} ({fitted.min():.3f}) | {own[0]['true_iou']:.3f} |"
        )


def times_of(episodes: list[dict[str, Any]], longest: Sequence[float]) -> Iterator[str]:
    """Return lines on how long scans take. The longest corrections were measured by themselves [s]."""
    seconds = [entry for one in episodes for entry in one["seconds"]]
    plain = 1e3 * np.array([time for time, is_corrected in seconds if not is_corrected])
    # A scan that is not matched takes microseconds.
    matched = plain[plain > 0.2]
    most = np.quantile(matched, 0.95)
    yield f"A scan that is matched takes {np.median(matched):.2f} ms (95 % within {most:.2f} ms)."
    if not longest:
        yield "The past was corrected at none."
        return
    corrected = 1e3 * np.concatenate([corrections_of(one) for one in episodes])
    yield (
        f"One at which the past is corrected takes {np.nanmedian(corrected):.1f} ms, and the longest "
        f"{1e3 * max(longest):.1f} ms (median of "
        f"{REPEATS} runs of its episode; {np.nanmax(corrected):.1f} ms is the most that was seen once)."
    )


def page(folder: Path) -> str:
    """Return the results as markdown."""
    episodes = kept_lines(folder / EPISODES_FILE)
    rates = kept_lines(folder / RATES_FILE)[0]["rates"]
    repeated = (line["longest_s"] for line in kept_lines(folder / LONGEST_FILE))
    longest = [seconds for seconds in repeated if seconds is not None]
    speed = (
        f"Five robots on building:17 make {np.median(rates):.0f} agent steps a second on one core ({min(rates):.0f} to "
        f"{max(rates):.0f}), policy, maps and localizers included."
    )
    table = [f"| {' | '.join(HEADER)} |", "|" + "---|" * len(HEADER), *rows_of(episodes)]
    lines = [
        "# Robots in worlds that are not ideal",
        "",
        ABOUT,
        "",
        *table,
        "",
        *times_of(episodes, longest),
        speed,
        "",
    ]
    return "\n".join(lines)


STUDY = Study(page, work=work, quick=14)
