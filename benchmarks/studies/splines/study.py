"""How well spline maps and the localizers on them do.

A Pioneer explores the worlds with a goal. A policy drives with true poses; what the laser measured, noise
included, and odometry with a bias of 5 % on motions go to a localizer. One localizer runs on odometry
alone. Times are CPU times of one process, map updates included.
"""

import itertools
import math
import statistics
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.agents import make_policy
from lidarium.benchmarks.results_page import in_file
from lidarium.benchmarks.studies.shared.map_figures import THESIS, MapFigures, follow, map_figures
from lidarium.benchmarks.studies.shared.study import Progress, Study, Task, do_missing, kept_lines
from lidarium.benchmarks.studies.splines import buildings
from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.floors.catalogue.names import load_floor
from lidarium.envs.floors.floor import Floor
from lidarium.envs.settings.making import make_settings
from lidarium.evaluation.drawing.spline_picture import save_spline_picture
from lidarium.evaluation.episodes.runner import run_episode
from lidarium.evaluation.episodes.watching import WatchedExploration, Watcher
from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.localization.on_splines.spline_ekf import SplineEkf
from lidarium.mapping.localization.on_splines.spline_filter import SplineFilter
from lidarium.mapping.localization.on_splines.spline_tracking import SplineTracker

TUNED_ON = ("srt_corridor", "srt_l_room", "srt_lab", "srt_t_junction", "srt_cluttered", "srt_cluttered_reachable")
FLOORS = (*TUNED_ON, "apartment")
"""Floors that come with a start. Settings were chosen on the first six, with other seeds."""

LOCALIZERS: dict[str, Callable[[], SplineTracker]] = {
    "splines": SplineFilter,
    "splines_ekf": SplineEkf,
    "splines_thesis": partial(SplineFilter, THESIS),
}
"""Localizers by name; the last one has `spline_settings("thesis")`: Dietmayer's test, corners by slopes, even knots."""
POLICY, RASTER, RESOLUTION, TIME_STEP = "nearest_frontier", 0.01, 0.05, 0.1
SEEDS = range(100, 103)
"""Of the runs of each line; settings were chosen with seeds 0 to 2."""

NOISE = "datasheet"
"""Noise of the laser."""

BIAS = 0.05
"""Share by which ways and turns of odometry are too long."""

FLOORS_FILE, BUILDINGS_FILE, PICTURES_FOLDER = "floors.jsonl", "buildings.jsonl", "pictures"


@dataclass(slots=True)
class Drive(Watcher):
    """What a robot measured while it drove, and the truth."""

    ranges: list[NDArray[np.float32]]
    poses: list[NDArray[np.float64]]

    def begin(self, env: ExplorationEnv) -> None:
        """Note the start."""
        self.step(env, np.empty(0))

    def step(self, env: ExplorationEnv, commands: NDArray[np.float64], /) -> None:
        """Note a time step."""
        self.ranges.append(env.simulation.ranges[0].copy())
        self.poses.append(env.world.poses[0].copy())

    def outcome(self, env: ExplorationEnv) -> None:
        """Note nothing."""


@dataclass(frozen=True, slots=True)
class Run:
    """Figures of one run, and what a step took [ms]."""

    figures: MapFigures
    step_ms: float
    step_p95_ms: float


@dataclass(frozen=True, slots=True)
class FloorTask(Task):
    """A floor on which all localizers are tried with all seeds."""

    floor: str


def drive(floor: Floor, seed: int) -> Drive:
    """Drive a Pioneer over a floor and return what it measured."""
    settings = make_settings(robots=1, robot="pioneer", noise=NOISE, resolution=RESOLUTION, raster_resolution=RASTER)
    watcher = Drive([], [])
    env = WatchedExploration(floor, settings, watchers=[watcher])
    run_episode(make_policy(POLICY), env, seed, {"starts": floor.starts[:1]})
    return watcher


def odometry(poses: NDArray[np.float64], seed: int) -> NDArray[np.float64]:
    """Return odometry (n, 3) along true poses (n, 3). Motions are too long by a share, and slip as wheels do."""
    generator = np.random.default_rng(seed)
    reckoned, place = [np.zeros(3)], Transform()
    for before, after in itertools.pairwise(poses):
        motion = Transform(*before.tolist()).inverse() @ Transform(*after.tolist())
        way, (along, aside, turn) = math.hypot(motion.x, motion.y), generator.standard_normal(3).tolist()
        step = Transform(
            motion.x * (1.0 + BIAS) + 0.02 * way * along,
            motion.y * (1.0 + BIAS) + 0.01 * way * aside,
            motion.theta * (1.0 + BIAS) + turn * (0.02 * abs(motion.theta) + 0.01 * way),
        )
        place = place @ step
        reckoned.append(np.array([place.x, place.y, place.theta]))
    return np.array(reckoned)


def measure(name: str, floor: Floor, walk: Drive, seed: int, picture: Path | None) -> Run:
    """Let a localizer follow a drive, and compare what it believes with the truth."""
    localizer: SplineTracker = LOCALIZERS[name]()
    poses = np.array(walk.poses)
    reckoned = odometry(poses, seed)
    localizer.reset(poses[0], seed)
    track, returns, seconds = follow(localizer, walk.ranges, reckoned, TIME_STEP)
    spline_map = localizer.map
    if picture is not None:
        save_spline_picture(picture, floor, spline_map, poses, track)
    figures = map_figures(floor, spline_map, localizer.geometry, poses, track, reckoned, returns)
    return Run(figures, 1000.0 * statistics.median(seconds[1:]), 1000.0 * float(np.quantile(seconds[1:], 0.95)))


def measure_floor(pictures: Path, task: FloorTask) -> dict[str, Any]:
    """Try all localizers on a floor with all seeds, and draw the first run of each."""
    floor = load_floor(task.floor)
    walks = [drive(floor, seed) for seed in SEEDS]
    localizers: dict[str, list[dict[str, Any]]] = {}
    for name in LOCALIZERS:
        runs = []
        for seed, walk in zip(SEEDS, walks, strict=True):
            picture = pictures / f"{task.floor}_{name}.png" if seed == SEEDS[0] else None
            runs.append(_as_entry(measure(name, floor, walk, seed, picture)))
        localizers[name] = runs
    return {"floor": task.floor, "localizers": localizers}


def _as_entry(run: Run) -> dict[str, Any]:
    """Return a run as JSON has it. A figure that is no number, as of a map without curves, is None."""
    entry = asdict(run)
    entry["figures"] = {name: value if math.isfinite(value) else None for name, value in entry["figures"].items()}
    return entry


def _run_of(entry: Mapping[str, Any]) -> Run:
    figures: dict[str, Any] = {name: math.nan if value is None else value for name, value in entry["figures"].items()}
    return Run(MapFigures(**figures), entry["step_ms"], entry["step_p95_ms"])


def work(folder: Path, _data: Path | None, every: int, workers: int) -> Progress:
    """Measure on every N-th floor, in this process alone, as steps are timed; then in buildings."""
    tasks = [FloorTask(floor) for floor in FLOORS[::every]]
    measured = partial(measure_floor, folder / PICTURES_FOLDER)
    yield from do_missing(folder / FLOORS_FILE, "floors", tasks, measured, 1)
    stays = [buildings.Stay(floor, name) for floor in buildings.FLOORS for name in buildings.LOCALIZERS]
    yield from do_missing(folder / BUILDINGS_FILE, "buildings", stays[::every], buildings.measure_stay, workers)


HEADER = (
    "| floor | localizer | ATE [mm] | end [mm] | end [deg] | odometry ATE / ours | wall error [mm] | "
    "its 95 % [mm] | walls found | curves right | bytes | of end points | of a 5 cm grid | "
    "step median, 95 % [ms] |\n" + "|---|---|" + "---:|" * 12
)


def row(floor: str, name: str, runs: list[Run]) -> str:
    """Return a line of the table: the worst of the runs, of times the median."""
    figures = [run.figures for run in runs]
    ratio = min(each.odometry_ate_m / each.ate_m for each in figures)
    return (
        f"| {floor} | `{name}` | {1000 * max(each.ate_m for each in figures):.0f} | "
        f"{1000 * max(each.end_m for each in figures):.0f} | {max(each.end_deg for each in figures):.2f} | {ratio:.1f} "
        f"| {1000 * max(each.wall_mean_m for each in figures):.1f} | "
        f"{1000 * max(each.wall_p95_m for each in figures):.0f} | {100 * min(each.recall for each in figures):.1f} % | "
        f"{100 * min(each.precision for each in figures):.1f} % | {max(each.size_bytes for each in figures)} | "
        f"{100 * max(each.of_end_points for each in figures):.1f} % | "
        f"{100 * max(each.of_grid for each in figures):.1f} % | {statistics.median(run.step_ms for run in runs):.1f}, "
        f"{statistics.median(run.step_p95_ms for run in runs):.1f} |"
    )


@dataclass(frozen=True, slots=True)
class Target:
    """A figure of a run, and the bound that the worst floor is to keep: at least or at most `bound`."""

    title: str
    bound: float
    is_least: bool
    digits: int
    value: Callable[[Run], float]


TARGETS = (
    Target("ATE [mm]", 50.0, False, 0, lambda run: 1000.0 * run.figures.ate_m),
    Target("end [mm]", 50.0, False, 0, lambda run: 1000.0 * run.figures.end_m),
    Target("end [deg]", 1.0, False, 2, lambda run: run.figures.end_deg),
    Target("odometry ATE / ours", 3.0, True, 1, lambda run: run.figures.odometry_ate_m / run.figures.ate_m),
    Target("wall error [mm]", 15.0, False, 1, lambda run: 1000.0 * run.figures.wall_mean_m),
    Target("its 95 % [mm]", 50.0, False, 0, lambda run: 1000.0 * run.figures.wall_p95_m),
    Target("walls found [%]", 95.0, True, 1, lambda run: 100.0 * run.figures.recall),
    Target("curves right [%]", 95.0, True, 1, lambda run: 100.0 * run.figures.precision),
    Target("bytes of end points [%]", 15.0, False, 1, lambda run: 100.0 * run.figures.of_end_points),
    Target("bytes of a 5 cm grid [%]", 10.0, False, 1, lambda run: 100.0 * run.figures.of_grid),
)
STEP_MS = 5.0
"""Longest step that is wanted, of 95 % of the steps [ms]."""


def target_table(floors: Sequence[Mapping[str, list[Run]]]) -> str:
    """Return the worst floor of each localizer beside what is to be reached."""
    lines = [f"| figure | to reach | {' | '.join(f'`{name}`' for name in LOCALIZERS)} |", "|---|" + "---:|" * 4]
    for target in TARGETS:
        worst = min if target.is_least else max
        values = [worst(target.value(run) for floor in floors for run in floor[name]) for name in LOCALIZERS]
        are_reached = [value >= target.bound if target.is_least else value <= target.bound for value in values]
        shown = [f"{value:.{target.digits}f}" for value in values]
        sign = ">=" if target.is_least else "<="
        lines.append(_target_row(target.title, f"{sign} {target.bound:g}", shown, are_reached))
    steps = [max(statistics.median(run.step_p95_ms for run in floor[name]) for floor in floors) for name in LOCALIZERS]
    are_reached = [value <= STEP_MS for value in steps]
    lines.append(_target_row("step, 95 % [ms]", f"<= {STEP_MS:g}", [f"{value:.1f}" for value in steps], are_reached))
    return "\n".join(lines)


def _target_row(title: str, wanted: str, shown: Sequence[str], are_reached: Sequence[bool]) -> str:
    cells = [text if is_reached else f"**{text}**" for text, is_reached in zip(shown, are_reached, strict=True)]
    return f"| {title} | {wanted} | {' | '.join(cells)} |"


MEANING = """\
*Walls found* are walls within 5 cm of which true beams end, *curves right* the share of the curves' length
within 5 cm of a wall. *Bytes* are those of the compact form, beside those of the scans' end points (two float32
each) and of a grid of 5 cm (one byte a cell). Steps are CPU times with 400 particles and 727 rays; every few steps
the map takes in a scan, which makes the 95 %. In bold: missed."""


def page(folder: Path) -> str:
    """Return the results as markdown."""
    floors = {
        line["floor"]: {name: [_run_of(entry) for entry in runs] for name, runs in line["localizers"].items()}
        for line in kept_lines(folder / FLOORS_FILE)
    }
    rows = [row(floor, name, runs) for floor, found in floors.items() for name, runs in found.items()]
    how = (
        f"A Pioneer P3-DX with the URG-04LX (`noise={NOISE}`) explores the worlds with a goal by `{POLICY}`, with true "
        "poses. The localizers follow on measured ranges and on odometry whose ways and turns are "
        f"{100 * BIAS:.0f} % too long, with slip of 2 %. Settings were chosen on the six worlds with a goal with seeds "
        "0 to 2; `apartment` had no part in it. `splines_thesis` is the particle filter on a map by the rules of the "
        f'thesis, `spline_settings("thesis")`. Figures are the worst of {len(SEEDS)} seeds from {SEEDS[0]} on, times '
        "their median; here of the worst floor, in the file of each."
    )
    table = in_file("\n".join([HEADER, *rows]))
    in_buildings = buildings.section(kept_lines(folder / BUILDINGS_FILE))
    targets = target_table(list(floors.values()))
    parts = ["# Spline maps and localization on them", how, targets, table, MEANING, in_buildings]
    return "\n\n".join(parts) + "\n"


STUDY = Study(page, work=work, quick=33)
