"""Suites as other projects evaluate: sensor, team, stop rule and figures.

They run on these projects' floors if any are at hand. Sources: the projects' own scripts at the commits
named. Differences that remain are listed in ``differences``; figures of such a run may be compared with a
project's only if none of them matters.
"""

import difflib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from lidarium.evaluation.suites.suite import Suite

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
    stop : dict
        As ``StopRule``.
    figures : tuple of str
        Keys of an episode's line that the project prints.
    files : tuple of str
        Patterns of its floors below the folder of real data.
    floors : tuple of str
        Substitutes if there are no such files; empty if there are none.
    differences : tuple of str
        Differences from the project.
    """

    project: str
    source: str
    robots: tuple[int, ...]
    settings: Mapping[str, Any]
    stop: Mapping[str, Any]
    figures: tuple[str, ...]
    files: tuple[str, ...] = ()
    floors: tuple[str, ...] = ()
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
_GRAPH = "robots drive at 1 m/s with a body of 1 cm; the project moves a point between the nodes of a graph"

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
            "the six scenes of 25 m x 25 m are drawn anew after their names",
            "path_m has every robot; the project prints that of robot 0",
        ),
    ),
    "ariadne": _Preset(
        project="ARiADNE (Cao et al., ICRA 2023)",
        source="marmotlab/ARiADNE 8d726ad, env.py and sensor.py",
        robots=(1,),
        settings={**_POINT, "lidar": _lidar(8.0, 720), "horizon_s": 3600.0},
        stop={"figure": "remaining_cells", "at_most": 250.0},
        figures=("path_m", "time_s"),
        files=("floorplans/synthetic_dungeon/ARiADNE__*.png",),
        differences=(
            _GRAPH,
            "four of the project's floors, where it has the first hundred of a listing that differs between machines",
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
        ),
    ),
    "ir2": _Preset(
        project="IR2 (Tan et al., IROS 2024)",
        source="marmotlab/IR2-Multi-Robot-RL-Exploration e53a6fc, env.py and test_driver.py",
        robots=(4, 5),
        settings={**_POINT, "lidar": _lidar(8.0, 720), "horizon_s": 3600.0},
        stop={"figure": "c_own_min", "at_least": 0.99, "decisions": 384},
        figures=("d99_m", "decisions", "c_own_mean_final", "success"),
        files=("floorplans/synthetic_dungeon/large-scale-DRL-__*.png",),
        differences=(
            _GRAPH,
            "the radio is ideal; the project's breaks with distance and walls",
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
        differences=(
            "floors of a sister project, smaller than 100 m x 100 m: the project's have no licence",
            "robots drive; the project moves them between the nodes of a graph",
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
        stop={"decisions": 1000},
        figures=("c_valid_final", "iou_occupied", "time_s"),
        files=(
            "floorplans/kth/xml/*50010535*",
            "floorplans/kth/xml/*5001584*",
            "floorplans/kth/xml/*5005274*",
            "floorplans/kth/xml/*50052750*",
        ),
        differences=(
            "a step is a second at 1 m/s",
            "starts are drawn by the seed; the project has a list of its own",
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
    """Return the floors of a preset.

    They are its files below a folder of real data, otherwise their substitutes.
    """
    files = [] if data is None else sorted(str(path) for pattern in preset.files for path in Path(data).glob(pattern))
    if files or preset.floors:
        return tuple(dict.fromkeys(files)) or preset.floors
    where = "no folder of real data was given" if data is None else f"there are none below {data}"
    raise ValueError(
        f"{preset.project} has floors in files ({', '.join(preset.files)}), and {where}; give --data, or "
        "--floors of your own"
    )


def preset_suite(
    name: str,
    policies: tuple[str, ...],
    seeds: tuple[int, ...],
    data: Path | None = None,
    floors: tuple[str, ...] = (),
) -> Suite:
    """Make the suite of a preset."""
    preset = preset_named(name)
    return Suite(
        policies=policies,
        floors=floors or _preset_floors(preset, data),
        robots=preset.robots,
        seeds=seeds,
        variants={name: preset.settings},
        stop=preset.stop,
    )
