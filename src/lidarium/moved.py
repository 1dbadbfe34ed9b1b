"""Old names of modules and of what is in them, kept for one release.

A module that has moved can still be imported by its old name, with a ``DeprecationWarning`` that names the
new one. The aliases go with release 0.3.
"""

import warnings
from importlib import import_module
from importlib.abc import Loader
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import Any

MOVED: dict[str, tuple[str, ...]] = {
    "agents.srt.drive": ("agents.srt.motion.drive",),
    "agents.srt.intent": ("agents.srt.motion.progress",),
    "agents.srt.motion.looks": ("agents.srt.motion.turn_plan",),
    "agents.srt.memory": (
        "agents.srt.memories.memory",
        "agents.srt.memories.map_memory",
        "agents.srt.memories.region_memory",
    ),
    "agents.srt.progress": ("agents.srt.motion.progress",),
    "agents.srt.tour": ("mapping.planning.tours",),
    "agents.supervisor.station": ("agents.supervisor.knowledge.station",),
    "agents.supervisor.survey": ("agents.supervisor.knowledge.survey", "agents.supervisor.knowledge.goals"),
    "agents.supervisor.knowledge.trails": ("envs.station.trails",),
    "agents.supervisor.trails": ("envs.station.trails",),
    "envs.batch.endings": ("envs.outcome.endings",),
    "envs.coverage": (
        "envs.scoring.coverage",
        "envs.scoring.rewards",
    ),
    "envs.episodes": ("envs.episode_start",),
    "envs.floors.buildings": ("envs.floors.generation.buildings",),
    "envs.floors.drawn": ("envs.floors.catalogue.drawn",),
    "envs.floors.furnishing": ("envs.floors.generation.furnishing",),
    "envs.floors.furniture": ("envs.floors.generation.furniture",),
    "envs.floors.layouts": ("envs.floors.generation.layouts",),
    "envs.floors.packing": ("envs.floors.generation.packing",),
    "envs.floors.plans": ("envs.floors.generation.plans",),
    "envs.floors.store": ("envs.floors.catalogue.store",),
    "envs.frame_parts": ("envs.drawing.frame_parts",),
    "envs.onboard.drives": ("envs.driving.drives",),
    "envs.onboard.driving": (
        "envs.driving.path_following",
        "envs.driving.safety_stop",
    ),
    "envs.onboard.exchange": (
        "envs.radio.exchange",
        "envs.radio.map_blocks",
        "envs.radio.radio_links",
    ),
    "envs.onboard.frontier_offers": ("envs.levels.frontier_offers",),
    "envs.onboard.operating": ("envs.station.operating",),
    "envs.onboard.planning": ("envs.driving.planning",),
    "envs.onboard.reports": ("envs.station.reports",),
    "envs.onboard.state": ("envs.radio.messages",),
    "envs.onboard.team_driver": ("envs.driving.team_driver",),
    "envs.onboard.team_mapping": ("envs.station.team_mapping",),
    "envs.onboard.traffic": ("envs.driving.traffic",),
    "envs.options": ("envs.settings.reset_options", "envs.floors.floor_choice"),
    "envs.rendering": ("envs.drawing.rendering",),
    "envs.scorer": (
        "envs.outcome.scorer",
        "envs.scoring.rewards",
    ),
    "envs.simulation.arrays": ("envs.simulation.kernels.arrays",),
    "envs.simulation.battery": ("envs.settings.battery",),
    "envs.simulation.face_casting": ("envs.simulation.kernels.face_casting",),
    "envs.simulation.faults": (
        "envs.settings.faults",
        "envs.simulation.disturbances.faults",
    ),
    "envs.simulation.floor_cache": ("envs.simulation.kernels.floor_cache",),
    "envs.simulation.floor_tables": ("envs.simulation.kernels.floor_tables",),
    "envs.simulation.kinematic": (
        "envs.simulation.kinematic_world",
        "envs.simulation.kinematic_simulation",
    ),
    "envs.simulation.lidar": (
        "envs.settings.lidar",
        "envs.simulation.kernels.ray_casting",
    ),
    "envs.simulation.motion": (
        "envs.simulation.kernels.motion",
        "envs.simulation.kernels.contact",
    ),
    "envs.simulation.noise": ("envs.simulation.disturbances.noise",),
    "envs.simulation.odometry": (
        "envs.settings.odometry",
        "envs.simulation.disturbances.odometry",
    ),
    "envs.simulation.radio": (
        "envs.settings.radio",
        "envs.simulation.disturbances.radio",
    ),
    "envs.simulation.ray_tables": ("envs.simulation.kernels.ray_tables",),
    "envs.simulation.robots": ("envs.settings.robots",),
    "envs.simulation.kernels.stages": ("envs.simulation.kernels.map_updates",),
    "envs.simulation.stages": ("envs.simulation.kernels.map_updates",),
    "envs.simulation.stepping": ("envs.simulation.kernels.stepping",),
    "envs.simulation.world": ("envs.simulation.backend",),
    "envs.solo": ("envs.levels.gymnasium_env",),
    "envs.wrappers.decisions": ("envs.levels.decisions",),
    "envs.wrappers.frontiers": ("envs.levels.frontiers",),
    "envs.wrappers.waypoints": ("envs.levels.waypoints",),
    "evaluation.beliefs": ("evaluation.truth.beliefs",),
    "evaluation.campaign": ("evaluation.suites.campaign",),
    "evaluation.episodes_file": ("evaluation.suites.episodes_file",),
    "evaluation.events": ("evaluation.episodes.events",),
    "evaluation.experiments": ("benchmarks.studies",),
    "evaluation.footprints": ("evaluation.truth.footprints",),
    "evaluation.history": ("evaluation.episodes.history",),
    "evaluation.interrupts": ("evaluation.episodes.interrupts",),
    "evaluation.map_tally": ("evaluation.truth.map_tally",),
    "evaluation.merge_picture": ("evaluation.drawing.merge_picture",),
    "evaluation.merging": ("benchmarks.studies.merging",),
    "evaluation.output": ("evaluation.episodes.output",),
    "evaluation.picture_parts": ("evaluation.drawing.picture_parts",),
    "evaluation.pictures": ("evaluation.drawing.run_picture",),
    "evaluation.presets": ("evaluation.suites.presets",),
    "evaluation.record.drawing": ("evaluation.drawing.record_frames",),
    "evaluation.report.episodes": ("evaluation.analysis.episodes",),
    "evaluation.report.figures": ("evaluation.analysis.figures",),
    "evaluation.report.floor_pictures": ("evaluation.drawing.floor_pictures",),
    "evaluation.report.groups": ("evaluation.analysis.groups",),
    "evaluation.report.plots": ("evaluation.drawing.plots", "evaluation.drawing.profiles"),
    "evaluation.report.records": ("evaluation.analysis.records",),
    "evaluation.report.style": ("evaluation.drawing.style",),
    "evaluation.result": ("evaluation.episodes.result",),
    "evaluation.runner": ("evaluation.episodes.runner",),
    "evaluation.spline_picture": ("evaluation.drawing.spline_picture",),
    "evaluation.srt": ("benchmarks.studies.srt",),
    "evaluation.stop_rules": ("evaluation.episodes.stop_rules",),
    "evaluation.suite": ("evaluation.suites.suite",),
    "evaluation.supervision": (
        "evaluation.episodes.supervision",
        "evaluation.drawing.supervision_marks",
    ),
    "evaluation.teams": ("benchmarks.studies.supervisor",),
    "evaluation.tree_picture": ("evaluation.drawing.tree_picture",),
    "evaluation.video": ("evaluation.drawing.video",),
    "evaluation.watching": ("evaluation.episodes.watching",),
    "evaluation.workers": ("evaluation.suites.workers",),
    "mapping.bit_words": ("mapping.kernels.bit_words",),
    "mapping.carmen_logs": ("mapping.files.carmen_logs",),
    "mapping.cell_blocks": ("mapping.kernels.cell_blocks",),
    "mapping.checks": ("mapping.geometry.checks",),
    "mapping.clearance": ("mapping.planning.clearance",),
    "mapping.clearance_blocks": ("mapping.kernels.clearance_blocks",),
    "mapping.clearance_updates": ("mapping.planning.clearance_updates",),
    "mapping.frontier_approach": ("mapping.planning.frontier_approach",),
    "mapping.frontiers": ("mapping.planning.frontiers",),
    "mapping.grid_lines": ("mapping.grids.grid_lines",),
    "mapping.grid_planning": (
        "mapping.planning.grid_planning",
        "mapping.planning.footprint",
        "mapping.planning.search.search_space",
    ),
    "mapping.grid_search": (
        "mapping.planning.search.grid_search",
        "mapping.planning.search.search_state",
    ),
    "mapping.growing": ("mapping.grids.growing_array",),
    "mapping.laser_logs": ("mapping.files.npz_logs", "mapping.files.laser_logs"),
    "mapping.merging.validation": ("mapping.merging.agreement.validation",),
    "mapping.level_changes": ("mapping.grids.map_deltas", "mapping.grids.overlaid_deltas"),
    "mapping.localization.branch_and_bound": ("mapping.localization.matching.branch_and_bound",),
    "mapping.localization.calibration": ("mapping.localization.slam.calibration",),
    "mapping.localization.closures": ("mapping.localization.graph.closures",),
    "mapping.localization.elimination": ("mapping.localization.graph.elimination",),
    "mapping.localization.following": ("mapping.localization.slam.following",),
    "mapping.localization.local_mapping": ("mapping.localization.matching.local_mapping",),
    "mapping.localization.localizer": ("mapping.localization.dead_reckoning.localizer",),
    "mapping.localization.node_graph": ("mapping.localization.graph.node_graph",),
    "mapping.localization.odometry": ("mapping.localization.dead_reckoning.odometry",),
    "mapping.localization.pose_graph": ("mapping.localization.graph.pose_graph",),
    "mapping.localization.scan_matching": (
        "mapping.localization.matching.scan_matching",
        "mapping.localization.matching.surface_normals",
    ),
    "mapping.localization.scan_points": ("mapping.localization.matching.scan_points",),
    "mapping.localization.scan_search": ("mapping.localization.matching.scan_search",),
    "mapping.localization.settings": (
        "mapping.localization.matching.settings.slam",
        "mapping.localization.matching.settings.matching",
        "mapping.localization.matching.settings.graph",
        "mapping.localization.matching.settings.odometry",
    ),
    "mapping.localization.spline_ekf": ("mapping.localization.on_splines.spline_ekf",),
    "mapping.localization.spline_filter": ("mapping.localization.on_splines.spline_filter",),
    "mapping.localization.spline_matches": ("mapping.localization.on_splines.spline_matches",),
    "mapping.localization.spline_tracking": ("mapping.localization.on_splines.spline_tracking",),
    "mapping.localization.submaps": ("mapping.localization.matching.submaps",),
    "mapping.localization.wall_compass": ("mapping.localization.matching.wall_compass",),
    "mapping.localization.wall_direction": ("mapping.localization.matching.wall_direction",),
    "mapping.map_crops": ("mapping.grids.map_crops",),
    "mapping.map_files": ("mapping.files.map_files",),
    "mapping.merging.corners": ("mapping.merging.description.corners",),
    "mapping.merging.described_map": ("mapping.merging.description.described_map",),
    "mapping.merging.descriptors": ("mapping.merging.description.descriptors",),
    "mapping.noisy_returns": ("mapping.grids.noisy_returns",),
    "mapping.occupancy": ("mapping.grids.occupancy",),
    "mapping.pages": ("mapping.kernels.huge_pages",),
    "mapping.path_search": (
        "mapping.planning.search.path_search",
        "mapping.planning.search.search_state",
    ),
    "mapping.path_smoothing": ("mapping.planning.path_smoothing",),
    "mapping.pooled_maps": ("mapping.grids.pooled_maps",),
    "mapping.processor": ("mapping.kernels.processor",),
    "mapping.rigid": ("mapping.geometry.rigid",),
    "mapping.scan_polygon": ("mapping.grids.scan_polygon",),
    "mapping.scans": ("mapping.grids.scan_geometry",),
    "mapping.search_targets": ("mapping.planning.search.search_targets",),
    "mapping.specks": ("mapping.grids.speckle_filter",),
    "mapping.splines.banded": ("mapping.splines.curves.banded",),
    "mapping.splines.basis": ("mapping.splines.curves.basis",),
    "mapping.splines.bspline": ("mapping.splines.curves.bspline",),
    "mapping.splines.fitting": ("mapping.splines.curves.fitting",),
    "mapping.splines.settings": ("mapping.splines.curves.settings",),
    "mapping.splines.spline_files": ("mapping.files.spline_files",),
    "mapping.swept": ("mapping.planning.footprint_masks",),
    "mapping.trajectories": ("mapping.files.trajectories",),
    "mapping.turned_blocks": ("mapping.grids.turned_crops",),
    "mapping.turns": ("mapping.kernels.work_queue",),
}
"""Where modules have gone, below ``lidarium``; one that was split has gone to several."""

MOVED_NAMES: dict[str, tuple[str, ...]] = {
    "agents.frontier": ("agents.frontier_policies",),
    "agents.policy": (
        "agents.catalogue",
        "agents.report",
    ),
    "envs.floors.catalogue": ("envs.floors.catalogue.names",),
    "envs.onboard.perception": ("envs.onboard.belief",),
    "envs.settings": (
        "envs.settings.exploration",
        "envs.settings.lidar",
        "envs.settings.realism",
    ),
    "envs.radio.exchange": ("envs.radio.map_blocks", "envs.radio.radio_links"),
    "envs.simulation.kernels.motion": ("envs.simulation.kernels.contact",),
    "evaluation.truth": ("evaluation.truth.true_map",),
    "evaluation.truth.map_counts": ("evaluation.truth.team_counts",),
    "mapping.files": (
        "mapping.files.output",
        "mapping.kernels.cache_folders",
    ),
    "mapping.files.laser_logs": ("mapping.files.npz_logs",),
    "mapping.files.map_files": ("mapping.files.images", "mapping.files.guarded_reading"),
    "mapping.grids.map_deltas": ("mapping.grids.overlaid_deltas",),
    "mapping.kernels": (
        "mapping.kernels.compilation",
        "mapping.kernels.views",
    ),
    "mapping.localization.slam": ("mapping.localization.slam.localizer",),
    "scripts.floors": ("scripts.output.floor_files",),
    "scripts.run": ("scripts.output.run_summary",),
}
"""Where the names of modules have gone that are there still, or are packages now."""

RENAMED: dict[str, dict[str, str]] = {
    "agents.srt.motion.looks": {"LOOK_GAIN": "TURN_GAIN", "Looks": "TurnPlan"},
    "agents.srt.senses": {"NEWS_S": "CONTACT_AGE_S"},
    "envs.batch.running": {"LOOKS": "SENSES"},
    "envs.driving.safety_stop": {"LEAST_MATE_GAP": "LEAST_TEAMMATE_GAP", "MATE_GAP": "TEAMMATE_GAP"},
    "envs.levels.frontier_choices": {"Looking": "ViewReach"},
    "envs.station.team_mapping": {"News": "TeammateMap"},
    "mapping.grids.map_deltas": {"LaidMaps": "OverlaidMaps"},
    "mapping.planning.footprint_masks": {"swept": "footprint_mask"},
    "scripts.common": {"tell": "notify"},
}
"""What names of modules are called now."""

MOVED_NAMES.update({module: (module,) for module in RENAMED if module not in (*MOVED, *MOVED_NAMES)})

_ROOT = "lidarium."


class MovedModule(ModuleType):
    """A module by its old name: its attributes are those of the modules that took its place."""

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401
        if name.startswith("__"):
            raise AttributeError(f"module {self.__name__!r} has no attribute {name!r}")
        return _found(self.__name__, MOVED[self.__name__.removeprefix(_ROOT)], name)


class MovedModules(Loader):
    """Finds modules by their old names, after all other finders have failed."""

    def find_spec(self, name: str, _path: object = None, _target: object = None) -> ModuleSpec | None:
        """Return the spec of a module that has moved, None for any other."""
        if not name.startswith(_ROOT) or name.removeprefix(_ROOT) not in MOVED:
            return None
        return ModuleSpec(name, self, is_package=True)

    def create_module(self, spec: ModuleSpec) -> ModuleType:
        """Return the module by its old name, and warn."""
        places = " and ".join(_ROOT + place for place in MOVED[spec.name.removeprefix(_ROOT)])
        warnings.warn(
            f"{spec.name} has moved to {places}; the old name goes with release 0.3",
            DeprecationWarning,
            stacklevel=2,
        )
        return MovedModule(spec.name)

    def exec_module(self, module: ModuleType) -> None:
        """Do nothing: attributes are looked up when they are asked for."""


def moved_name(module: str, name: str) -> Any:  # noqa: ANN401
    """Return a name that a module had, from where it has gone, and warn; the module's ``__getattr__``.

    Raises
    ------
    AttributeError
        Where the name is nowhere.
    """
    places = MOVED_NAMES[module.removeprefix(_ROOT)]
    renamed = RENAMED.get(module.removeprefix(_ROOT), {}).get(name)
    if name.startswith("_"):
        raise AttributeError(f"module {module!r} has no attribute {name!r}")
    found = _found(module, places, name)
    place = getattr(found, "__module__", None) or " or ".join(_ROOT + place for place in places)
    change = f"has moved to {place}" if renamed is None else f"is now called {renamed}"
    warnings.warn(
        f"{module}.{name} {change}; the old name goes with release 0.3",
        DeprecationWarning,
        stacklevel=3,
    )
    return found


def renamed_method(old: str, new: str) -> Any:  # noqa: ANN401
    """Return a method for the old name of one that is called ``new`` now."""

    def method(self: Any, *arguments: Any, **options: Any) -> Any:  # noqa: ANN401
        warnings.warn(
            f"{type(self).__name__}.{old} is now called {new}; the old name goes with release 0.3",
            DeprecationWarning,
            stacklevel=2,
        )
        return getattr(self, new)(*arguments, **options)

    method.__name__, method.__doc__ = old, f"Call ``{new}``, as this method is called now; it warns."
    return method


def _found(module: str, places: tuple[str, ...], name: str) -> Any:  # noqa: ANN401
    name = RENAMED.get(module.removeprefix(_ROOT), {}).get(name, name)
    for place in places:
        # Not by getattr: a place may itself search a name that it lacks where names have moved.
        found = vars(import_module(_ROOT + place))
        if name in found:
            return found[name]
    raise AttributeError(f"module {module!r} has no attribute {name!r}")
