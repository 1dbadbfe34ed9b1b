"""Suites as other projects evaluate: sensor, team, stop rule and figures.

They run on these projects' floors if any are at hand. Sources: the projects' own scripts at the commits
named. Differences that remain are listed in ``differences``; figures of such a run may be compared with a
project's only if none of them matters.
"""

import csv
import difflib
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from lidarium.envs.floors.catalogue.names import load_floor
from lidarium.envs.floors.free_space import cell_of
from lidarium.envs.simulation.kernels.floor_cache import floor_tables
from lidarium.evaluation.suites.suite import Starts, Suite
from lidarium.mapping.files.images import read_image
from lidarium.mapping.grids.grid_lines import visible

_FULL_CIRCLE = 6.283185307179586
_CLOCK = "time is simulated, not that of a clock on the wall"


@dataclass(frozen=True, slots=True, kw_only=True)
class _Preset:
    """Evaluation protocol of a project.

    Attributes
    ----------
    project, source : str
        Project, and source of the numbers.
    robots : tuple of int
        Sizes of teams.
    settings : dict
        Options of ``lidarium.parallel_env``.
    stop : dict or None
        As ``StopRule``; ``decisions`` may be by the number of robots. None if only the settings end episodes.
    figures : tuple of str
        Keys of an episode's line that the project prints.
    files : tuple of str
        Patterns of its floors below the folder of real data.
    floors : tuple of str
        Substitutes if there are no such files; empty if there are none.
    image_resolution : float or None
        Metres per pixel of its floors, if they are images without a scale of their own.
    starts : callable or None
        Takes a file and returns the teams of starts there; by default robots start at the floor's own starts.
    differences : tuple of str
        Differences from the project.
    """

    project: str
    source: str
    robots: tuple[int, ...]
    settings: Mapping[str, Any]
    stop: Mapping[str, Any] | None
    figures: tuple[str, ...]
    files: tuple[str, ...] = ()
    floors: tuple[str, ...] = ()
    image_resolution: float | None = None
    starts: Callable[[Path], Sequence[Starts]] | None = None
    differences: tuple[str, ...] = field(default=())


def _lidar(reach: float, beams: int, view: float = _FULL_CIRCLE, noise: float = 0.0) -> dict[str, float]:
    return {
        "beams": beams,
        "field_of_view": view,
        "range_min": 0.0,
        "range_max": reach,
        "noise_floor": noise,
        "noise_share": 0.0,
    }


_POINT = {"robot": "point", "resolution": 0.1, "stop_coverage": None}
_DRIVES = "robots drive at 1 m/s with a body of 1 cm; the project moves a point between the nodes of a graph"
_MARK = "robots start at the middle of the map's mark; the project takes one of its pixels"


def _around_mark(count: int, apart: float) -> Callable[[Path], Sequence[Starts]]:
    """Return a function of starts of a team: at the mark, and the nearest places in sight of it that are apart [m]."""

    def starts(path: Path) -> Sequence[Starts]:
        floor = load_floor(str(path))
        if not len(floor.starts):
            return []
        raster = floor_tables(floor, _RASTER, 0.1, 0.1).body
        mark = cell_of(raster, floor.starts[0])
        free = np.argwhere(~raster.solid)
        free = free[np.argsort(np.hypot(*(free - np.array(mark)).T), kind="stable")]
        free = free[visible(np.where(raster.solid, np.int8(1), np.int8(-1)), mark, free)]
        taken = [tuple(float(value) for value in floor.starts[0])]
        for row, column in free.tolist():
            place = (raster.origin[0] + (column + 0.5) * _RASTER, raster.origin[1] + (row + 0.5) * _RASTER)
            if len(taken) < count and all(math.dist(place, other[:2]) >= apart for other in taken):
                taken.append((*place, 0.0))
        return [tuple(taken)] if len(taken) == count else []  # type: ignore[arg-type]

    return starts


_RASTER = 0.1
"""Side of the cells in which starts around a mark are looked for [m]."""

_DARE_PIXEL = 0.2


def _dare_start(path: Path) -> Sequence[Starts]:
    """Return DARE's start on a map: the eleventh pixel of the mark when the picture is halved by minima."""
    pixels = read_image(path)
    rows, columns = (side // 2 for side in pixels.shape)
    halved = pixels[: 2 * rows, : 2 * columns].reshape(rows, 2, columns, 2).min(axis=(1, 3))
    marked = np.argwhere(halved == 208)
    row, column = marked[10]
    side = 2.0 * _DARE_PIXEL
    height = pixels.shape[0] * _DARE_PIXEL
    return [((((column + 0.5) * side), height - (row + 0.5) * side, 0.0),)]


def _mapex_starts(path: Path) -> Sequence[Starts]:
    """Return the starts that MapEx lists for a map, but for those in walls and outside of the building."""
    free = np.pad((read_image(path) != 0).astype(np.uint8), 1, constant_values=1)
    areas = cv2.connectedComponents(free, connectivity=4)[1]
    is_inside = ((free != 0) & (areas != areas[0, 0]))[1:-1, 1:-1]
    rows = len(is_inside)
    lines = (path.parent / "starts.csv").read_text(encoding="utf-8").splitlines()
    listed = [line for line in csv.reader(lines) if not line[0].startswith("#") and line[0] == path.stem]
    places = [(int(row) - _MAPEX_PADDING, int(column) - _MAPEX_PADDING) for _, row, column in listed]
    inside = [place for place in places if is_inside[place]]
    return [(((column + 0.5) * 0.1, (rows - row - 0.5) * 0.1, 0.0),) for row, column in inside]


_MAPEX_PADDING = 500
"""Cells that the project adds around its maps."""

PRESETS: dict[str, _Preset] = {
    "explore-bench": _Preset(
        project="Explore-Bench, level 0 (Xu et al., ICRA 2022)",
        source="efc-robot/Explore-Bench ce3b98a, grid_simulator/GridEnv.py and exploration_benchmark/scripts",
        robots=(1, 2),
        settings={**_POINT, "lidar": _lidar(3.5, 720), "horizon_s": 1800.0},
        stop={"figure": "c_known", "at_least": 0.98},
        figures=("t90_s", "time_s", "balance", "overlap_eb", "path_m"),
        floors=(
            "scene_loop",
            "scene_corridor",
            "scene_corner",
            "scene_room",
            "scene_loop_corridor",
            "scene_room_corner",
        ),
        differences=(
            _CLOCK,
            "the six scenes of 25 m x 25 m are redrawn from their names",
            "path_m covers every robot; the project reports only robot 0",
        ),
    ),
    "ariadne": _Preset(
        project="ARiADNE (Cao et al., ICRA 2023)",
        source="marmotlab/ARiADNE 8d726ad, env.py, node.py, graph_generator.py and sensor.py",
        robots=(1,),
        settings={
            **_POINT,
            "lidar": _lidar(8.0, 720),
            "horizon_s": 3600.0,
            "level": "graph",
            "graph": {"spacing": 1.9, "utility_share": 0.875, "least_utility": 2, "frontier_spacing": 0.4},
        },
        stop={"figure": "remaining_cells", "at_most": 250.0, "decisions": 128},
        figures=("path_m", "decisions", "success"),
        files=("floorplans/ariadne/test100/*.png", "floorplans/synthetic_dungeon/ARiADNE__*.png"),
        differences=(
            _MARK,
            "nodes are 1.9 m apart, 24 around each; the project's are 2.2 m apart along x and 1.7 m along y, with "
            "edges among the 20 nearest",
        ),
    ),
    "dare": _Preset(
        project="DARE (Cao et al., ICRA 2025)",
        source="marmotlab/DARE, parameter.py, classes/env and classes/agent",
        robots=(1,),
        settings={
            "robot": "point",
            "lidar": _lidar(20.0, 720),
            "resolution": 0.4,
            "raster_resolution": _DARE_PIXEL,
            "stop_coverage": None,
            "horizon_s": 3600.0,
            "level": "graph",
        },
        stop=None,
        figures=("path_m", "success"),
        files=("floorplans/dungeon_test/*.png",),
        image_resolution=_DARE_PIXEL,
        starts=_dare_start,
        differences=(
            "walls keep the pixels of 0.2 m; the project halves its pictures",
            "the laser sees all free space in sight; the project walks along lines of cells that end where they pass a "
            "corner of a wall, so that more has to be looked at. Its nearest and utility planners take 671 m and "
            "631 m on its first 27 maps, ours 607 m and 581 m; with a laser like ours, its own take 580 m and 549 m on "
            "twelve of these maps, ours 586 m and 554 m",
        ),
    ),
    "chen": _Preset(
        project="Self-learning exploration (Chen et al., IROS 2019)",
        source="RobustFieldAutonomyLab/DRL_robot_exploration b611d20, scripts/robot_simulation.py",
        robots=(1,),
        settings={**_POINT, "lidar": _lidar(8.0, 720), "horizon_s": 3600.0},
        stop={"figure": "c_free", "above": 0.985},
        figures=("path_m", "decisions"),
        files=("floorplans/synthetic_dungeon/DRL_robot_explor__*.png",),
        differences=(
            "robots drive at 1 m/s with a body of 1 cm; the project jumps to one of 50 places around the robot",
            _MARK,
        ),
    ),
    "ir2": _Preset(
        project="IR2 (Tan et al., IROS 2024)",
        source="marmotlab/IR2-Multi-Robot-RL-Exploration e53a6fc, env.py, test_parameter.py, ss_realistic_model.py",
        robots=(4, 5),
        settings={**_POINT, "lidar": _lidar(8.0, 720), "horizon_s": 3600.0, "radio": "signal"},
        stop={"figure": "c_own_min", "at_least": 0.99, "decisions": {"4": 196, "5": 384}},
        figures=("d99_m", "decisions", "c_own_mean_final", "success"),
        files=("floorplans/synthetic_dungeon/large-scale-DRL-__*.png",),
        starts=_around_mark(5, 1.3),
        differences=(
            _DRIVES,
            "robots start at the mark and at the places nearest to it, 1.3 m apart; the project's at nodes in sight",
            "losses of the radio are their means; the project draws them for each episode",
            "floors of a sister project: the project's have no licence",
        ),
    ),
    "marvel": _Preset(
        project="MARVEL (Chiun et al., ICRA 2025)",
        source="marmotlab/MARVEL 1e2e17d, utils/test_worker.py",
        robots=(4,),
        settings={
            "robot": {
                "radius": 0.05,
                "cruise_speed": 1.0,
                "max_speed": 1.0,
                "max_turn_rate": 0.6109,
                "max_acceleration": 10.0,
                "max_turn_acceleration": 60.0,
            },
            "lidar": _lidar(10.0, 241, 2.0943951),
            "resolution": 0.4,
            "stop_coverage": None,
            "horizon_s": 3600.0,
        },
        stop={"figure": "c_free", "above": 0.99, "decisions": 128},
        figures=("d99_m", "d90_m", "success", "overlap_mv"),
        files=("floorplans/synthetic_dungeon/large-scale-DRL-__*.png",),
        starts=_around_mark(4, 4.0),
        differences=(
            "floors of a sister project, smaller than 100 m x 100 m: the project's have no licence",
            "robots drive; the project moves them between the nodes of a graph",
            "robots start at the mark and at the places nearest to it, 4 m apart, and head east; the project draws "
            "nodes in sight of the mark and headings",
        ),
    ),
    "maexp": _Preset(
        project="MAexp, indoor (Zhu et al., ICRA 2024)",
        source="DuangZhu/MAexp 6c0014e, env_v7.py",
        robots=(3,),
        settings={
            "robot": {"radius": 0.15, "cruise_speed": 0.6, "max_speed": 0.6, "max_acceleration": 0.2},
            "lidar": _lidar(1.0, 360),
            "resolution": 0.05,
            "stop_coverage": None,
            "stop_on_contact": True,
            "horizon_s": 1800.0,
        },
        stop={"figure": "c_free", "above": 0.95},
        figures=("coverage_final", "t85_s", "t95_s", "overlap_mx_85", "overlap_mx_95"),
        floors=("apartment", "clinic"),
        differences=(
            "the package's own floors: the project's scans of houses are not in its repository",
            "RV, the deviation of learners' returns, is not printed",
        ),
    ),
    "mapex": _Preset(
        project="MapEx (Ho et al., ICRA 2025)",
        source="castacks/MapEx b607ed3, scripts/calc_metrics_subdirectory.py",
        robots=(1,),
        settings={
            "robot": "point",
            "lidar": _lidar(20.0, 2500),
            "resolution": 0.1,
            "stop_coverage": None,
            "horizon_s": 1000.0,
        },
        stop=None,
        figures=("c_valid_final", "iou_occupied", "time_s"),
        files=("floorplans/mapex/*.png",),
        image_resolution=0.1,
        starts=_mapex_starts,
        differences=(
            "a step is a second at 1 m/s",
            "22 of the project's 60 starts: of the 24 on maps that are at hand one is in a wall, one outside",
            "the project also fills in what it has not seen",
        ),
    ),
    "houseexpo": _Preset(
        project="HouseExpo with PseudoSLAM (Li et al., 2019)",
        source="TeaganLi/HouseExpo 45e2b25, config_exploration.yaml and robot_exploration_v0.py",
        robots=(1,),
        settings={
            "robot": {"radius": 0.15, "cruise_speed": 0.33},
            "lidar": _lidar(5.0, 258, 3.14159265, 0.1),
            "resolution": 0.04,
            "raster_resolution": 0.02,
            "decision_period_s": 1.0,
            "stop_coverage": None,
            "horizon_s": 1800.0,
        },
        stop={"figure": "c_free", "above": 0.95, "decisions": 200},
        figures=("success", "decisions", "coverage_final"),
        files=("floorplans/houseexpo/*.json",),
        differences=(
            "a step is a second of driving, about the 0.3 m of the project's step forward",
            "two floors that can be had on their own",
        ),
    ),
}
"""Presets by name."""


def preset_named(name: str) -> _Preset:
    """Return a preset."""
    if name not in PRESETS:
        nearest = difflib.get_close_matches(name, PRESETS, n=1)
        guess = f", did you mean {nearest[0]!r}?" if nearest else ""
        raise ValueError(f"no preset called {name!r}{guess}; there are {', '.join(PRESETS)}")
    return PRESETS[name]


def _preset_floors(preset: _Preset, data: Path | None) -> tuple[str, ...]:
    """Return the floors of a preset, in the project's order.

    They are the files of its first pattern that has any below a folder of real data, otherwise their substitutes.
    """
    found = [] if data is None else [_in_order(Path(data), pattern) for pattern in preset.files]
    files = next((files for files in found if files), [])
    if preset.starts is not None:
        files = [path for path in files if preset.starts(path)]
    if files or preset.floors:
        return tuple(str(path) for path in files) or preset.floors
    where = "no folder of real data was given" if data is None else f"there are none below {data}"
    raise ValueError(
        f"{preset.project} has floors in files ({', '.join(preset.files)}), and {where}; give --data, or "
        "--floors of your own"
    )


def _in_order(data: Path, pattern: str) -> list[Path]:
    """Return the files of a pattern by name, or as ORDER.txt beside them lists them."""
    files = sorted(data.glob(pattern))
    listing = files[0].parent / "ORDER.txt" if files else data
    if not listing.is_file():
        return files
    places = {line.split()[1]: int(line.split()[0]) for line in listing.read_text(encoding="utf-8").splitlines()}
    return sorted(files, key=lambda path: places[path.name])


def preset_suite(
    name: str,
    policies: tuple[str, ...],
    seeds: tuple[int, ...],
    data: Path | None = None,
    floors: tuple[str, ...] = (),
) -> Suite:
    """Make the suite of a preset; on floors of a user's own, robots start at the floors' starts."""
    preset = preset_named(name)
    chosen = floors or _preset_floors(preset, data)
    return Suite(
        policies=policies,
        floors=chosen,
        robots=preset.robots,
        seeds=seeds,
        draws_starts=False,
        starts={floor: preset.starts(Path(floor)) for floor in chosen} if preset.starts and not floors else {},
        variants={name: preset.settings},
        stop=preset.stop,
        image_resolution=preset.image_resolution,
    )
