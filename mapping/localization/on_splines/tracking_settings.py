"""Settings that both localizers on spline maps share."""

import math
from dataclasses import dataclass, field

from lidarium.mapping.geometry.bounds import (
    Angle,
    Count,
    Counted,
    FromZero,
    Positive,
    Turn,
    check_settings,
)
from lidarium.mapping.localization.matching.settings.graph import GraphSettings
from lidarium.mapping.localization.matching.settings.slam import SlamSettings
from lidarium.mapping.splines.curves.settings import SplineSettings

_GRAPH = GraphSettings(deviation_m=0.003, deviation_per_metre=0.006, deviation_angle=math.radians(0.03))
"""Curves follow walls a little closer than cells: chosen where true poses lie within the spread."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackingSettings:
    """How a pose is kept on a map of curves.

    Attributes
    ----------
    splines : SplineSettings
        How scans become curves, and curves a map.
    turn_per_turn, turn_per_metre, slip_per_metre, slip_per_turn : float
        Standard deviations of odometry: of a turn, for each radian and each metre [1, rad/m]; of a distance,
        for each metre and each radian [1, m/rad].
    feature_sigma, line_angle_sigma : float
        Least standard deviations of features: of points and of the distance of lines [m], of the direction of
        lines [rad].
    curve_sigma : float
        Standard deviation of the distance between a ray's end and its curve [m].
    curve_distance : float
        Rays that end farther from any curve see what is new, and say nothing of the pose [m].
    ray_stride : int
        Every so many-th beam that returned counts.
    ray_share : float
        What a ray counts, since neighbours are correlated.
    least_sightings : int
        Corners and peaks of the map count from so many scans on.
    least_features, least_rays : int
        With fewer matches of both kinds the pose is predicted only.
    still_distance, still_turn : float
        A robot that has moved less since its last correction is not corrected again: what it sees is not new
        [m, rad].
    map_distance, map_turn : float
        The map takes in a scan whenever the robot has moved as far since the last one [m, rad].
    path : SlamSettings
        How local maps follow each other, places are recognised and poses brought to agree; its matching
        serves to recognise places only.
    """

    splines: SplineSettings = field(default_factory=SplineSettings)
    turn_per_turn: FromZero = 0.15
    turn_per_metre: FromZero = 0.06
    slip_per_metre: FromZero = 0.10
    slip_per_turn: FromZero = 0.03
    feature_sigma: Positive = 0.02
    line_angle_sigma: Angle = math.radians(1.0)
    curve_sigma: Positive = 0.03
    curve_distance: Positive = 0.3
    ray_stride: Count = 8
    ray_share: Positive = 0.5
    least_sightings: Count = 3
    least_features: Counted = 2
    least_rays: Counted = 20
    still_distance: FromZero = 0.001
    still_turn: Turn = math.radians(0.1)
    map_distance: Positive = 0.1
    map_turn: Angle = math.radians(5.0)
    path: SlamSettings = field(default_factory=lambda: SlamSettings(graph=_GRAPH))

    def __post_init__(self) -> None:
        check_settings(self, "tracking")
