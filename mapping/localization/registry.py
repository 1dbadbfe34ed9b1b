"""The localizers by name."""

from collections.abc import Callable
from dataclasses import dataclass

from lidarium.mapping.grids.scan_geometry import ScanGeometry
from lidarium.mapping.localization.dead_reckoning.localizer import Localizer


@dataclass(frozen=True, slots=True)
class Entry:
    """A localizer that can be chosen by name.

    Attributes
    ----------
    description : str
        What it does, in a line.
    make : callable
        Makes one from the geometry of the laser's scans.
    """

    description: str
    make: Callable[[ScanGeometry], Localizer]


def _odometry(geometry: ScanGeometry) -> Localizer:
    from lidarium.mapping.localization.dead_reckoning.odometry import Odometry

    return Odometry()


def _slam(geometry: ScanGeometry) -> Localizer:
    from lidarium.mapping.localization.matching.settings import SlamSettings
    from lidarium.mapping.localization.slam.localizer import Slam

    return Slam(SlamSettings(), geometry)


def _splines(geometry: ScanGeometry) -> Localizer:
    from lidarium.mapping.localization.on_splines.spline_filter import SplineFilter

    return SplineFilter(geometry=geometry)


def _splines_ekf(geometry: ScanGeometry) -> Localizer:
    from lidarium.mapping.localization.on_splines.spline_ekf import SplineEkf

    return SplineEkf(geometry=geometry)


LOCALIZERS: dict[str, Entry] = {
    "odometry": Entry("dead reckoning from the start by the wheels", _odometry),
    "slam": Entry("scans matched with local maps, places recognised, the past corrected", _slam),
    "splines": Entry("a particle filter on walls kept as B-splines and their features", _splines),
    "splines_ekf": Entry(
        "an extended Kalman filter on the features of walls kept as B-splines", _splines_ekf
    ),
}
"""The localizers by name; the modules of each are imported when it is first made."""


def localizer_names() -> tuple[str, ...]:
    """Return the names of all localizers."""
    return tuple(LOCALIZERS)


def make_localizer(name: str, geometry: ScanGeometry) -> Localizer:
    """Make a localizer by name, for a laser at the centre of the robot.

    Raises
    ------
    ValueError
        Where the name is unknown.
    """
    if name not in LOCALIZERS:
        raise ValueError(f"unknown localizer {name!r}; known are {', '.join(LOCALIZERS)}")
    return LOCALIZERS[name].make(geometry)
