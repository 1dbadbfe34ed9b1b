"""The value of the parts of localization on curves. The same paths are followed with one part changed."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from types import MappingProxyType
from typing import Any

import numpy as np

from lidarium.benchmarks.studies.shared.map_figures import THESIS, follow, map_figures
from lidarium.benchmarks.studies.shared.study import Task
from lidarium.benchmarks.studies.srt.goal_runs import GoalRun, drive_to_goal
from lidarium.evaluation.suites.episodes_file import KEY
from lidarium.mapping.localization.on_splines.spline_filter import SplineFilter, SplineFilterSettings
from lidarium.mapping.splines.settings import AssociationSettings, FitSettings, SegmentationSettings, SplineSettings

_DEFAULT = SplineFilterSettings()
NO_CORNER = 3.1
"""An angle that no two walls reach [rad]."""


def _with_splines(splines: SplineSettings) -> SplineFilterSettings:
    return replace(_DEFAULT, tracking=replace(_DEFAULT.tracking, splines=splines))


VARIANTS: Mapping[str, tuple[str, SplineFilterSettings]] = MappingProxyType(
    {
        "default": ("as it is", _DEFAULT),
        "dietmayer": (
            "breakpoints by Dietmayer's test",
            _with_splines(SplineSettings(segmentation=SegmentationSettings(test="dietmayer"))),
        ),
        "pedraza": (
            "breakpoints by Pedraza's test",
            _with_splines(SplineSettings(segmentation=SegmentationSettings(test="pedraza"))),
        ),
        "no_corners": (
            "no cut at corners",
            _with_splines(SplineSettings(segmentation=SegmentationSettings(corner_angle=NO_CORNER))),
        ),
        "slopes": (
            "corners by the difference of slopes, as in the thesis",
            _with_splines(SplineSettings(segmentation=SegmentationSettings(corner_rule="slope"))),
        ),
        "robot_origin": (
            "lines compared about the robot, as in the thesis",
            _with_splines(SplineSettings(association=AssociationSettings(line_origin="robot"))),
        ),
        "thesis": ("all rules of the thesis", THESIS),
        "particles_50": ("50 particles", replace(_DEFAULT, particles=50)),
        "particles_1000": ("1000 particles", replace(_DEFAULT, particles=1000)),
        "wheels_as_told": (
            "no bias of odometry learned",
            replace(_DEFAULT, distance_bias=0.0, turn_bias=0.0, bias_wander=0.0),
        ),
        "fixed_knots": (
            "knots every 0.25 m",
            _with_splines(SplineSettings(fit=FitSettings(finest_spacing=0.25, is_sparse=False))),
        ),
    }
)
"""Variants by name: about, and settings."""


@dataclass(frozen=True, slots=True)
class FollowedWay(Task):
    """A way of the default mode in a world, to be followed by all variants."""

    world: str
    seed: int


def measure_variants(task: FollowedWay) -> dict[str, Any]:
    """Drive once, and let each variant follow what was sensed. Returns a line with the figures of all."""
    episode, _, way = drive_to_goal(GoalRun("default", task.world, task.seed))
    floor, settings = episode.env.floor, episode.env.settings
    assert floor is not None
    figures = {}
    for name, (_, variant) in VARIANTS.items():
        localizer = SplineFilter(variant, settings.lidar)
        localizer.reset(way.true[0].copy(), task.seed)
        true, odometry = np.array(way.true), np.array(way.odometry)
        believed, returns, _ = follow(localizer, way.ranges, odometry, settings.time_step)
        figures[name] = asdict(map_figures(floor, localizer.map, settings.lidar, true, believed, odometry, returns))
    return {KEY: task.key, "world": task.world, "seed": task.seed, "variants": figures}
