"""All settings of merging in one place, and the two sets of them that have names."""

import math
from dataclasses import dataclass, field

from lidarium.mapping.geometry.bounds import Angle, FromZero, Length, check_settings
from lidarium.mapping.merging.agreement import ValidationSettings
from lidarium.mapping.merging.alignment import AlignmentSettings
from lidarium.mapping.merging.bend.estimation import BendSettings
from lidarium.mapping.merging.corners import CornerSettings
from lidarium.mapping.merging.correlation import CorrelationSettings
from lidarium.mapping.merging.correspondence import CorrespondenceSettings
from lidarium.mapping.merging.descriptors import DescriptorSettings
from lidarium.mapping.merging.regions.segmentation import RegionSettings

MODES = ("default", "thesis")

STRUCTURES = ("corners", "regions", "all")
"""Sources of transforms before all rotations and translations are tried."""

TOLERANCES = {"strict": 2.0, "normal": 0.8, "drift": 0.6}
"""Confidence from which maps are joined that agree only once they are bent, by the name of the tolerance."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MergeSettings:
    """How maps are merged.

    Attributes
    ----------
    corners, descriptors, correspondence, alignment, validation, correlation
        Settings of each stage.
    structure : str, default "corners"
        One of `STRUCTURES`: ``corners``; ``regions`` of free space and the doors between them; ``all`` for
        regions if corners give no transform that passes.
    regions : RegionSettings
        How regions are found and matched.
    bend : BendSettings
        How much maps may be bent if no rigid motion is believed.
    confidence : float
        Confidence from which maps that agree once they are bent are joined; see `TOLERANCES`. Above 1 none
        are.
    cycle_distance_m, cycle_angle : float
        By how much transforms around a cycle of maps may miss identity [m, rad].
    """

    corners: CornerSettings = field(default_factory=CornerSettings)
    descriptors: DescriptorSettings = field(default_factory=DescriptorSettings)
    correspondence: CorrespondenceSettings = field(default_factory=CorrespondenceSettings)
    alignment: AlignmentSettings = field(default_factory=AlignmentSettings)
    validation: ValidationSettings = field(default_factory=ValidationSettings)
    correlation: CorrelationSettings = field(default_factory=CorrelationSettings)
    structure: str = "corners"
    regions: RegionSettings = field(default_factory=RegionSettings)
    bend: BendSettings = field(default_factory=BendSettings)
    confidence: FromZero = TOLERANCES["normal"]
    cycle_distance_m: Length = 0.15
    cycle_angle: Angle = math.radians(3.0)

    def __post_init__(self) -> None:
        check_settings(self, "merging")
        if self.structure not in STRUCTURES:
            raise ValueError(f"structure of merging is {self.structure!r}; want one of {', '.join(STRUCTURES)}")
        if self.structure != "corners" and self.validation.test == "discs":
            raise ValueError("the disc test needs matched corners; want structure corners with it")


def merge_settings(mode: str = "default", resolution: float = 0.025) -> MergeSettings:
    """Return the settings of a mode.

    Parameters
    ----------
    mode : str
        ``default``, or ``thesis`` for the rules of the thesis as they were printed: all corners, one ring
        band of 25 cells, similarity over all samples, rotations in steps of 22.5 degrees, inliers by the
        ratio of coordinates, a sweep, the disc test, no fallback.
    resolution : float
        Side of a cell [m]; the thesis counts in cells.

    Returns
    -------
    MergeSettings
        The settings.

    Raises
    ------
    ValueError
        If there is no such mode.
    """
    if mode == "default":
        return MergeSettings()
    if mode != "thesis":
        raise ValueError(f"mode of merging is {mode!r}; want one of {', '.join(MODES)}")
    descriptors = DescriptorSettings(
        variant="polar",
        radius_min=resolution,
        radius_max=25.0 * resolution,
        radius_step=resolution,
        columns=360,
        occupied=1.0,
        unknown=0.5,
        free=0.0,
    )
    correspondence = CorrespondenceSettings(
        threshold=0.80, shift_window=math.radians(12.0), is_known_only=False, use_shift=False
    )
    alignment = AlignmentSettings(
        inlier_rule="ratio",
        least_inliers=3,
        angle_uncertainty=math.radians(22.5),
        candidates=1,
        refinements=("sweep",),
    )
    return MergeSettings(
        corners=CornerSettings(separation_m=0.0, limit=0),
        descriptors=descriptors,
        correspondence=correspondence,
        alignment=alignment,
        validation=ValidationSettings(test="discs"),
        correlation=CorrelationSettings(rotations=0),
        confidence=TOLERANCES["strict"],
    )
