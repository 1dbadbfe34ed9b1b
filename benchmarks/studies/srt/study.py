"""The sensor-based random tree study.

It has the worlds in the thesis's mode and the default one, full exploration, and what its parts are worth.
"""

from pathlib import Path

from lidarium.benchmarks.results_page import in_file
from lidarium.benchmarks.studies.shared.study import Progress, Study, do_missing, kept_lines
from lidarium.benchmarks.studies.srt import tables
from lidarium.benchmarks.studies.srt.ablations import FollowedWay, measure_variants
from lidarium.benchmarks.studies.srt.goal_runs import (
    MODES,
    TREES,
    VARIED_ON,
    WORLDS,
    GoalRun,
    measure_goal_run,
    measure_tree,
)
from lidarium.benchmarks.studies.srt.pictures import draw_coverage, draw_world
from lidarium.evaluation.suites.episodes_file import read_episodes
from lidarium.evaluation.suites.suite import Suite
from lidarium.evaluation.suites.trial import DEFAULT_VARIANT

SEEDS, STARTS, FOLLOWED, VARIED = range(200, 230), range(100, 105), range(200, 203), range(200, 205)
"""Seeds of the runs, of the starts, of the paths of variants, and of trees by variants of the thesis's rules.

Runs are of each world and mode, starts of each explored floor, paths those that variants follow. None of the
seeds had a part in any choice.
"""

POLICIES = ("srt", "nearest_frontier", "explore_lite")
SCENES = ("scene_corner", "scene_corridor", "scene_loop", "scene_loop_corridor", "scene_room", "scene_room_corner")
EXPLORATION, SETTINGS = "exploration", {"resolution": 0.025, "stop_coverage": 0.99, "horizon_s": 3600.0}
GOALS_FILE, TREES_FILE, ABLATIONS_FILE = "goals.jsonl", "trees.jsonl", "ablations.jsonl"
PICTURE_SEED = SEEDS[0]

TUNED_ON = (
    f"Seeds are {SEEDS[0]} and on; choices were made on others of the same worlds. Parameters that the thesis does not "
    "print (free rays of 0.9 m, step, least distance) were chosen among about twenty settings with seeds 0 to 19, for "
    "goals that are reached, though slower and with more nodes, which flatters the ratios. The default mode was tuned "
    "with seeds 0 to 5, its localization with seeds 0 to 3, with a look at 100 to 102."
)
"""What the runs towards goals owe to choices that were made on the same worlds."""


def suites(_data: Path | None, every: int = 1) -> dict[str, Suite]:
    """Return the suite of full exploration, with every that many-th floor and start."""
    from lidarium.envs.floors.catalogue.names import set_floors

    floors = (*SCENES, *set_floors("validation:10"))[::every]
    suite = Suite(policies=POLICIES, floors=floors, seeds=tuple(STARTS[::every]), variants={DEFAULT_VARIANT: SETTINGS})
    return {EXPLORATION: suite}


def work(folder: Path, _data: Path | None, every: int, workers: int) -> Progress:
    """Drive towards the goals with every that many-th seed, then let variants follow.

    What is there is not done again.
    """
    runs = [GoalRun(mode, world, seed) for seed in SEEDS[::every] for world in WORLDS for mode in MODES]
    yield from do_missing(folder / GOALS_FILE, "runs towards goals", runs, measure_goal_run, workers)
    trees = [GoalRun(tree, floor, seed) for seed in VARIED[::every] for floor in VARIED_ON for tree in TREES]
    yield from do_missing(folder / TREES_FILE, "variants of the thesis's tree", trees, measure_tree, workers)
    ways = [FollowedWay(world, seed) for seed in FOLLOWED for world in WORLDS][::every]
    yield from do_missing(folder / ABLATIONS_FILE, "ablations", ways, measure_variants, workers)


def page(folder: Path) -> str:
    """Return the results as markdown."""
    runs, trees, followed = (kept_lines(folder / name) for name in (GOALS_FILE, TREES_FILE, ABLATIONS_FILE))
    episodes = read_episodes(folder / EXPLORATION / "episodes.jsonl")
    parts = [
        "# Sensor-based random tree",
        "[The reference](../reference/srt.md) describes the tree.",
        "## Towards goals",
        "A Pioneer P3-DX with the URG-04LX (noise of its data sheet) looks for the goal of each world, with "
        '`odometry="typical"` (5 % bias of ways and turns, drift, slip) and `localization="splines"`, on the map that '
        "it makes. A goal is reached within 0.2 m. Entries are medians, least and greatest; the area covered is the "
        "least, the distance from the start the greatest. *Printed* are the thesis's figures of its own worlds, of "
        "which only descriptions exist: ours are drawn after these, so its figures are no target. In `srt_cluttered` "
        "the goal is enclosed: `unreachable`, with all covered and the robot back at the start, is right.",
        tables.goals(runs),
        TUNED_ON,
        "The default mode over the thesis's mode on the same seeds: ratios of sums, and least and greatest of single "
        "runs.",
        in_file(tables.against_thesis_mode(runs)),
        "![Covered area over time](srt_coverage.png)",
        "## Variants of the thesis's rules",
        'The thesis\'s mode drives by MOVE_TO with the list of controls (`drive="controls"`), on stars as safe regions '
        'and spline maps by the thesis\'s rules (`spline_settings("thesis")`). Each variant replaces one rule by '
        "another of the thesis: the controller of turn and advance, balls, one radius for each ray, the base "
        "algorithm, and the farthest point of an opening. In `apartment` there is no goal: with known poses, the robot "
        "explores until 99 % are covered or 1,200 s are over.",
        in_file(tables.trees(trees)),
        "## Poses and maps",
        "Means, in brackets the worst of the runs. *Walls found* are walls within 5 cm of which true beams end, "
        "*curves right* the share of the curves' length within 5 cm of a wall. Bytes are those of the compact form, "
        "beside those of the scans' end points (two float32 each) and of a grid of 5 cm (one byte a cell).",
        in_file(tables.maps(runs)),
        "\n".join(
            f"![{world}: tree, safe regions, curves and truth](srt_world_{world.removeprefix('srt_')}.png)"
            for world in WORLDS
        ),
        "## Full exploration",
        "One robot with true poses explores until 99 % is covered, on maps of 2.5 cm; starts are drawn by the seed, "
        "the same for every policy. The six scenes had a part in the choices, with other starts; the ten generated "
        "floors of the validation set had none, except that two faults which they showed were mended "
        "(`office:2000006`, `office:2000009`). Means over the starts; the last columns are our mean over that of the "
        "better of the others.",
        in_file(tables.exploration(episodes, POLICIES)),
        "## What parts are worth",
        f"{len(followed)} ways of the default mode, followed by the particle filter with one part changed. Means, in "
        "brackets the worst.",
        in_file(tables.ablations(followed)),
    ]
    return "\n\n".join(parts) + "\n"


def pictures(folder: Path, out: Path) -> None:
    """Draw a picture of each world, and the curves of coverage, besides the page."""
    draw_coverage(out / "srt_coverage.png", read_episodes(folder / GOALS_FILE))
    for world in WORLDS:
        draw_world(out / f"srt_world_{world.removeprefix('srt_')}.png", world, PICTURE_SEED)


STUDY = Study(page, suites, work, pictures, quick=30)
