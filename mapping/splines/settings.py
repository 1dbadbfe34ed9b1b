"""All settings of spline maps in one place, and the two named sets of them."""

import math
from dataclasses import dataclass, field
from typing import Annotated

from lidarium.mapping.geometry.bounds import (
    Angle,
    Count,
    Duration,
    FromZero,
    Positive,
    Turn,
    above,
    check_settings,
    within,
)

MODES = ("default", "thesis")
BREAKPOINT_TESTS = ("adaptive", "dietmayer", "pedraza")
CORNER_RULES = ("angle", "slope")
LINE_ORIGINS = ("segment", "robot")


@dataclass(frozen=True, slots=True, kw_only=True)
class PointSettings:
    """How a scan becomes points.

    Attributes
    ----------
    beam_interval_s : float, default 0.0
        Time between neighbouring beams [s]; 0 for a scan that is taken at once.
    laser_x : float, default 0.0
        How far the laser sits ahead of the robot's middle [m].
    noise_floor, noise_share : float, default 0.01
        Standard deviation of a range: max(noise_floor, noise_share * range) [m, 1].
    """

    beam_interval_s: Duration = 0.0
    laser_x: Annotated[float, within(-100.0, 100.0)] = 0.0
    noise_floor: Positive = 0.01
    noise_share: FromZero = 0.01

    def __post_init__(self) -> None:
        check_settings(self, "points")


@dataclass(frozen=True, slots=True, kw_only=True)
class SegmentationSettings:
    """Settings of the cuts between points of a scan.

    Attributes
    ----------
    test : str, default "adaptive"
        Rule for neighbouring points on different surfaces. ``adaptive``: farther apart than on
        a wall at the grazing angle ``incidence`` and than noise explains; ``dietmayer``: farther apart than
        on a wall at right angles plus a constant, as in the thesis; ``pedraza``: the steps to both sides
        differ by more than ``step_ratio``, or the way turns by more than ``most_turn``.
    incidence : float
        Smallest angle between a beam and a wall that is still one surface [rad].
    noise_sigmas : float, default 3.0
        Standard deviations of the noise that are no break.
    dietmayer_floor, dietmayer_share : float, default 0.03
        The constant of Dietmayer's test: max(floor, share * range) [m, 1].
    step_ratio, most_turn : float
        Of Pedraza's test [1, rad].
    least_points : int, default 4
        Smaller clusters are left out.
    split_distance : float, default 0.04
        Points are split if one lies farther from the line through the ends [m].
    split_sigmas : float, default 4.0
        And farther than this number of standard deviations of its noise.
    collinear_angle : float
        Neighbouring lines that differ by less are tried as one [rad].
    corner_angle : float
        A split is a corner if the directions before and after it differ by more [rad].
    corner_rule : str
        ``angle`` between directions; ``slope``, difference of slopes as in the thesis, against the tangent of
        ``corner_angle``.
    corner_reach : float, default 0.25
        Length of wall on both sides on which directions are measured [m], or ten standard deviations of the
        noise.
    line_points : int, default 8
        Minimum number of points of straight pieces that are features.
    """

    test: str = "adaptive"
    incidence: Annotated[float, above(0.0, math.pi / 2.0)] = math.radians(10.0)
    noise_sigmas: FromZero = 3.0
    dietmayer_floor: FromZero = 0.03
    dietmayer_share: FromZero = 0.03
    step_ratio: Positive = 1.75
    most_turn: Angle = math.pi / 4.0
    least_points: Annotated[int, within(4, 1_000_000)] = 4
    split_distance: Positive = 0.04
    split_sigmas: FromZero = 4.0
    collinear_angle: Turn = math.radians(5.0)
    corner_angle: Angle = math.radians(20.0)
    corner_rule: str = "angle"
    corner_reach: Positive = 0.25
    line_points: Annotated[int, within(2, 1_000_000)] = 8

    def __post_init__(self) -> None:
        _check_name(self.test, "test of breakpoints", BREAKPOINT_TESTS)
        _check_name(self.corner_rule, "rule of corners", CORNER_RULES)
        check_settings(self, "segmentation")


@dataclass(frozen=True, slots=True, kw_only=True)
class FitSettings:
    """How many control points a curve gets.

    Attributes
    ----------
    spacing : float, default 0.25
        Usual distance of knots [m].
    finest_spacing : float, default 0.08
        Minimum spacing of knots, if the curve does not follow the points [m].
    rms : float, default 0.02
        A curve follows if the root mean square of its distances is at most this [m].
    explained : float, default 1.25
        It also follows if that is at most this multiple of the standard deviation of the points' noise, if
        that is known.
    is_sparse : bool, default True
        Whether a curve begins as a straight one, then with four free control points, however long, and gets
        more only if it does not follow.
    stiffness : float, default 1e-06
        Weight of the second differences of control points; keeps undetermined ones in line.
    """

    spacing: Annotated[float, within(1e-3, 1000.0)] = 0.25
    finest_spacing: Annotated[float, within(1e-3, 1000.0)] = 0.08
    rms: Annotated[float, within(1e-6, 1000.0)] = 0.02
    explained: FromZero = 1.25
    is_sparse: bool = True
    stiffness: FromZero = 1e-6

    def __post_init__(self) -> None:
        check_settings(self, "the fit")
        if self.finest_spacing > self.spacing:
            raise ValueError(
                f"finest_spacing of the fit is {self.finest_spacing} m, above its spacing {self.spacing} m"
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class AssociationSettings:
    """When two curves, or two features, are of the same wall.

    Attributes
    ----------
    control_distance : float, default 0.3
        Rough step: some control points of both curves are nearer than this [m].
    mean_distance, mean_turn : float
        Fine step: in the overlap, curves lie at most so far apart and differ at most so much in direction, in
        the mean [m, rad].
    least_overlap : float, default 0.2
        Shorter overlaps show nothing [m].
    point_distance : float, default 0.15
        Corners and ends nearer than this are the same [m].
    line_distance, line_angle : float
        Lines nearer than this are the same [m, rad].
    line_origin : str, default "segment"
        About which point lines are compared: the middle of the ``segment`` that was seen, or the foot of the
        perpendicular from the ``robot``, as in the thesis, which moves with it.
    """

    control_distance: Positive = 0.30
    mean_distance: Positive = 0.10
    mean_turn: Angle = math.radians(20.0)
    least_overlap: Positive = 0.20
    point_distance: Positive = 0.15
    line_distance: Positive = 0.10
    line_angle: Angle = math.radians(5.0)
    line_origin: str = "segment"

    def __post_init__(self) -> None:
        _check_name(self.line_origin, "line_origin of association", LINE_ORIGINS)
        check_settings(self, "association")


@dataclass(frozen=True, slots=True, kw_only=True)
class MapSettings:
    """How the map keeps seen walls.

    Attributes
    ----------
    sample_spacing : float, default 0.05
        Curves are joined and compared by points so far apart [m].
    rms : float, default 0.004
        Joined curves follow their points to this root mean square [m].
    most_weight : float, default 40.0
        A point of a curve never weighs more than this number of observations at a standard deviation of 1 cm, so
        that the map can still learn.
    least_extension : float, default 0.08
        Extensions beyond the end of a curve by less are noise [m].
    blend_length : float, default 0.5
        Over this length the joint of a curve with its extension fades [m].
    least_length : float, default 0.1
        Shorter curves do not begin a new wall [m].
    least_sigmas : float, default 6.0
        Nor do curves shorter than this number of standard deviations of their noise.
    explained_distance : float, default 0.1
        Nor do curves most of which lies nearer than this to curves of the map [m], or nearer than three
        standard deviations.
    trusted_count, trusted_length, trial_updates : int, float, int
        Corners, peaks and shorter curves that fewer scans have seen are forgotten after so many updates
        without seeing them [m].
    """

    sample_spacing: Annotated[float, within(1e-3, 1000.0)] = 0.05
    rms: Annotated[float, within(1e-6, 1000.0)] = 0.004
    most_weight: Positive = 40.0
    least_extension: FromZero = 0.08
    blend_length: Positive = 0.5
    least_length: FromZero = 0.1
    least_sigmas: FromZero = 6.0
    explained_distance: FromZero = 0.1
    trusted_count: Count = 3
    trusted_length: FromZero = 0.3
    trial_updates: Count = 20

    def __post_init__(self) -> None:
        check_settings(self, "the map")


@dataclass(frozen=True, slots=True, kw_only=True)
class SplineSettings:
    """How scans become a map of curves: the settings of each stage."""

    points: PointSettings = field(default_factory=PointSettings)
    segmentation: SegmentationSettings = field(default_factory=SegmentationSettings)
    fit: FitSettings = field(default_factory=FitSettings)
    association: AssociationSettings = field(default_factory=AssociationSettings)
    map: MapSettings = field(default_factory=MapSettings)


def spline_settings(mode: str = "default") -> SplineSettings:
    """Return the settings of a mode.

    Parameters
    ----------
    mode : str
        ``default``, or ``thesis`` for the rules of the thesis: Dietmayer's breakpoints, corners by the
        difference of slopes, knots at a fixed spacing, lines compared by the foot of the perpendicular from
        the robot.

    Raises
    ------
    ValueError
        If there is no such mode.
    """
    _check_name(mode, "mode of spline maps", MODES)
    if mode == "default":
        return SplineSettings()
    return SplineSettings(
        segmentation=SegmentationSettings(test="dietmayer", corner_rule="slope", corner_angle=math.radians(30.0)),
        fit=FitSettings(is_sparse=False, finest_spacing=0.25),
        association=AssociationSettings(point_distance=0.30, line_origin="robot"),
    )


def _check_name(name: str, what: str, known: tuple[str, ...]) -> None:
    if name not in known:
        raise ValueError(f"{what} is {name!r}; want one of {', '.join(known)}")
