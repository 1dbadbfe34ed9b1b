"""lidarium: teams of lidar robots explore unknown floors, in PettingZoo and Gymnasium environments.

Everything that users need is here, and is imported when it is first used. All other modules are internal and may move.
After ``import lidarium`` Gymnasium and PettingZoo know ``lidarium/Exploration-v1``,
``lidarium/WaypointExploration-v1``, ``lidarium/FrontierExploration-v1`` and ``lidarium/Exploration3D-v1``.
"""

import sys
from importlib import import_module
from typing import TYPE_CHECKING, Any

import gymnasium
import pettingzoo

from lidarium.registry import registry as registry

if TYPE_CHECKING:
    from importlib.machinery import ModuleSpec

    from lidarium.agents.catalogue import make_policy as policy
    from lidarium.agents.catalogue import register_policy
    from lidarium.agents.policy import PerRobot, Policy
    from lidarium.agents.supervisor.policy import Supervised
    from lidarium.envs.engine.reward_terms import reward_term
    from lidarium.envs.faces.makers import env, parallel_env, sb3_vec_env, vector_env
    from lidarium.envs.faces.merged_maps import MergedMaps
    from lidarium.envs.faces.parallel import ExplorationEnv
    from lidarium.envs.faces.sparse_planning import SparsePlanning
    from lidarium.envs.faces.team_exchange import MergingSettings
    from lidarium.envs.floors.catalogue.names import load_floor
    from lidarium.envs.floors.catalogue.names import set_floors as floor_set
    from lidarium.envs.floors.floor import Floor, Solid
    from lidarium.envs.floors.generation.buildings import BuildingSettings, generate_building
    from lidarium.envs.floors.importers import Format as FloorFormat
    from lidarium.envs.levels import level
    from lidarium.envs.levels.velocity import VelocityLevel
    from lidarium.envs.levels.waypoint import WaypointLevel
    from lidarium.envs.observing.observables import observable
    from lidarium.envs.onboard.radio.messages import Order, Route, Stop, Target
    from lidarium.envs.settings.battery import Battery
    from lidarium.envs.settings.cameras import DepthCamera
    from lidarium.envs.settings.exploration import ExplorationSettings
    from lidarium.envs.settings.faults import Fault, FaultSettings
    from lidarium.envs.settings.lidar import Lidar
    from lidarium.envs.settings.making import make_settings
    from lidarium.envs.settings.odometry import OdometrySettings
    from lidarium.envs.settings.radio import RadioSettings
    from lidarium.envs.settings.rewards import RewardSettings
    from lidarium.envs.settings.robots import Robot
    from lidarium.envs.simulation.backends import simulation_of
    from lidarium.evaluation.drawing.films import film
    from lidarium.evaluation.episodes.runner import run_episode
    from lidarium.evaluation.metrics import metric
    from lidarium.evaluation.record.recorder import record
    from lidarium.evaluation.report.page import replay
    from lidarium.evaluation.suites.campaign import evaluate
    from lidarium.mapping.files.log_files import read_log
    from lidarium.mapping.files.map_files import read_ros_map as read_map
    from lidarium.mapping.files.map_files import write_ros_map as write_map
    from lidarium.mapping.localization.slam.following import run_slam
    from lidarium.mapping.merging.merger import merge_maps
    from lidarium.mapping.merging.settings import MergeSettings
    from lidarium.mapping.point_clouds.cloud_files import read_cloud
    from lidarium.mapping.sparse.graph import build_graph
    from lidarium.mapping.sparse.mapper.full import map_cloud
    from lidarium.mapping.sparse.planning import plan
    from lidarium.mapping.sparse.settings import MapperSettings
    from lidarium.mapping.sparse.swept_body import SweptBody
    from lidarium.scripts.commands import command
    from lidarium.scripts.common import Answer, Command
    from lidarium.training.reinforcement.frontier_policy import FrontierPolicy

__version__ = "0.3.0"

_FACE: dict[str, str] = {
    "Answer": "lidarium.scripts.common",
    "Battery": "lidarium.envs.settings.battery",
    "BuildingSettings": "lidarium.envs.floors.generation.buildings",
    "Command": "lidarium.scripts.common",
    "DepthCamera": "lidarium.envs.settings.cameras",
    "ExplorationEnv": "lidarium.envs.faces.parallel",
    "ExplorationSettings": "lidarium.envs.settings.exploration",
    "Fault": "lidarium.envs.settings.faults",
    "FaultSettings": "lidarium.envs.settings.faults",
    "Floor": "lidarium.envs.floors.floor",
    "FloorFormat": "lidarium.envs.floors.importers:Format",
    "FrontierPolicy": "lidarium.training.reinforcement.frontier_policy",
    "Lidar": "lidarium.envs.settings.lidar",
    "MapperSettings": "lidarium.mapping.sparse.settings",
    "MergeSettings": "lidarium.mapping.merging.settings",
    "MergedMaps": "lidarium.envs.faces.merged_maps",
    "MergingSettings": "lidarium.envs.faces.team_exchange",
    "OdometrySettings": "lidarium.envs.settings.odometry",
    "Order": "lidarium.envs.onboard.radio.messages",
    "PerRobot": "lidarium.agents.policy",
    "Policy": "lidarium.agents.policy",
    "RadioSettings": "lidarium.envs.settings.radio",
    "RewardSettings": "lidarium.envs.settings.rewards",
    "Robot": "lidarium.envs.settings.robots",
    "Route": "lidarium.envs.onboard.radio.messages",
    "Solid": "lidarium.envs.floors.floor",
    "SparsePlanning": "lidarium.envs.faces.sparse_planning",
    "Stop": "lidarium.envs.onboard.radio.messages",
    "Supervised": "lidarium.agents.supervisor.policy",
    "SweptBody": "lidarium.mapping.sparse.swept_body",
    "Target": "lidarium.envs.onboard.radio.messages",
    "VelocityLevel": "lidarium.envs.levels.velocity",
    "WaypointLevel": "lidarium.envs.levels.waypoint",
    "build_graph": "lidarium.mapping.sparse.graph",
    "command": "lidarium.scripts.commands",
    "env": "lidarium.envs.faces.makers",
    "evaluate": "lidarium.evaluation.suites.campaign",
    "film": "lidarium.evaluation.drawing.films",
    "floor_set": "lidarium.envs.floors.catalogue.names:set_floors",
    "generate_building": "lidarium.envs.floors.generation.buildings",
    "level": "lidarium.envs.levels",
    "load_floor": "lidarium.envs.floors.catalogue.names",
    "make_settings": "lidarium.envs.settings.making",
    "map_cloud": "lidarium.mapping.sparse.mapper.full",
    "merge_maps": "lidarium.mapping.merging.merger",
    "metric": "lidarium.evaluation.metrics",
    "observable": "lidarium.envs.observing.observables",
    "parallel_env": "lidarium.envs.faces.makers",
    "plan": "lidarium.mapping.sparse.planning",
    "policy": "lidarium.agents.catalogue:make_policy",
    "read_cloud": "lidarium.mapping.point_clouds.cloud_files",
    "read_log": "lidarium.mapping.files.log_files",
    "read_map": "lidarium.mapping.files.map_files:read_ros_map",
    "record": "lidarium.evaluation.record.recorder",
    "register_policy": "lidarium.agents.catalogue",
    "registry": "lidarium.registry",
    "replay": "lidarium.evaluation.report.page",
    "reward_term": "lidarium.envs.engine.reward_terms",
    "run_episode": "lidarium.evaluation.episodes.runner",
    "run_slam": "lidarium.mapping.localization.slam.following",
    "sb3_vec_env": "lidarium.envs.faces.makers",
    "simulation_of": "lidarium.envs.simulation.backends",
    "vector_env": "lidarium.envs.faces.makers",
    "write_map": "lidarium.mapping.files.map_files:write_ros_map",
}
"""The module of each public name; ``module:name`` if it is called otherwise there."""

__all__ = [*_FACE, "__version__"]  # pyright: ignore[reportUnsupportedDunderAll]


def __getattr__(name: str) -> Any:  # noqa: ANN401
    """Import a public name when it is first used."""
    if name not in _FACE:
        raise AttributeError(f"module 'lidarium' has no attribute {name!r}")
    module, _, attribute = _FACE[name].partition(":")
    found = getattr(import_module(module), attribute or name)
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


class _MovedModules:
    """Names the new module when a path of release 0.2 is imported."""

    @staticmethod
    def find_spec(name: str, path: object = None, target: object = None) -> "ModuleSpec | None":
        """Raise ImportError for a module that has moved; return None for any other."""
        if not name.startswith("lidarium.") or name == "lidarium.moved":
            return None
        from lidarium.moved import check_moved

        check_moved(name)
        return None


if not any(getattr(finder, "__name__", "") == _MovedModules.__name__ for finder in sys.meta_path):
    sys.meta_path.append(_MovedModules)

_SEES = ("scan", "pose", "velocity", "bumper", "map")

_IDS: dict[str, dict[str, Any]] = {
    "Exploration": {"level": "velocity", "observe": _SEES},
    "WaypointExploration": {"level": "waypoint", "observe": _SEES},
    "FrontierExploration": {"level": "frontier", "observe": _SEES},
    "Exploration3D": {"level": "velocity", "camera": "xtion", "observe": (*_SEES, "depth")},
}
"""The options of each id; options of the maker go before."""

_VERSIONS: dict[int, dict[str, Any]] = {
    0: {"starts": "fixed", "frontiers": 16, "least_frontier": 0.1, "frontiers_by_size": 0.0},
    1: {"starts": "drawn"},
}
"""Options of each version of the ids: those that have other defaults since, or that a seed needs."""

_UNSEEN: dict[int, tuple[str, ...]] = {0: (), 1: ("pose",)}
"""What each version shows only if ``observe`` asks for it: learners overfit to positions."""


def _register(name: str, version: int, options: dict[str, Any]) -> None:
    """Make an environment known to Gymnasium and to PettingZoo, once."""
    registered = f"lidarium/{name}-v{version}"
    if registered in gymnasium.registry:
        return
    gymnasium.register(
        id=registered,
        entry_point="lidarium.envs.faces.gymnasium_env:SoloExploration",
        vector_entry_point="lidarium.envs.faces.vector_env:make_vector_env",
        kwargs=options,
    )
    # Versions of PettingZoo before 1.27 have no register of environments.
    if not hasattr(pettingzoo, "register"):
        return
    pettingzoo.register("parallel", registered, entry_point="lidarium:parallel_env", kwargs=options)
    pettingzoo.register("aec", registered, entry_point="lidarium:env", kwargs=options)


for _name, _options in _IDS.items():
    for _version, _more in _VERSIONS.items():
        _sees = tuple(each for each in _options["observe"] if each not in _UNSEEN[_version])
        _register(_name, _version, {**_options, **_more, "observe": _sees})

_TASKS = {
    "Buildings": (1, 2, 4, 8),
    "Homes": (2,),
    "RobotMaps": (2,),
    "Dungeons": (1,),
    "Lab": (3,),
    "UnknownStarts": (3,),
    "BrokenRadio": (4,),
    "DepthCamera": (1,),
    "Bullet": (2,),
}
"""Tasks of lidarium-1 and their sizes of teams: ids such as ``lidarium/Buildings-2-v1``."""


def _register_task(task: str, robots: int) -> None:
    """Make a task known to PettingZoo, and to Gymnasium if it is for one robot, once."""
    registered, maker = f"lidarium/{task}-v1", "lidarium.evaluation.benchmark.tasks"
    if robots == 1 and registered not in gymnasium.registry:
        gymnasium.register(id=registered, entry_point=f"{maker}:make_solo_task", kwargs={"task": task})
    if hasattr(pettingzoo, "register") and registered not in pettingzoo.parallel_registry:
        pettingzoo.register("parallel", registered, entry_point=f"{maker}:make_task", kwargs={"task": task})


for _name, _teams in _TASKS.items():
    for _robots in _teams:
        _register_task(f"{_name}-{_robots}", _robots)

if "IPython" in sys.modules:
    from IPython import get_ipython

    if (_shell := get_ipython()) is not None:
        import_module("lidarium.notebooks").show_pictures(_shell)
