"""The localizers by name."""

from typing import Any, Protocol

from lidarium.mapping.grids.scan_geometry import ScanGeometry
from lidarium.mapping.localization.localizer import Localizer
from lidarium.registry import Registry


class LocalizerClass(Protocol):
    """Type of the entries: a class of localizers.

    Attributes
    ----------
    Settings : type
        The dataclass of its own settings; its defaults are those of the localizer.
    """

    Settings: type[Any]

    def __call__(self, settings: Any, geometry: ScanGeometry) -> Localizer:  # noqa: ANN401
        """Make a localizer from its settings, for a laser at the centre of the robot."""
        ...


LOCALIZERS: Registry[LocalizerClass] = Registry("localizer")
"""The localizers by name; the module of each is imported when it is first made."""

_PACKAGE = "lidarium.mapping.localization"
LOCALIZERS.register("odometry", f"{_PACKAGE}.odometry:Odometry", "dead reckoning from the start by the wheels")
LOCALIZERS.register(
    "slam",
    f"{_PACKAGE}.slam.localizer:Slam",
    "scans matched with local maps, places recognised, the past corrected",
)
LOCALIZERS.register(
    "splines",
    f"{_PACKAGE}.on_splines.spline_filter:SplineFilter",
    "a particle filter on walls kept as B-splines and their features",
)
LOCALIZERS.register(
    "splines_ekf",
    f"{_PACKAGE}.on_splines.spline_ekf:SplineEkf",
    "an extended Kalman filter on the features of walls kept as B-splines",
)


def make_localizer(name: str, geometry: ScanGeometry, settings: Any = None) -> Localizer:  # noqa: ANN401
    """Make a localizer by name, for a laser at the centre of the robot.

    Parameters
    ----------
    name : str
        Its name in ``LOCALIZERS``.
    geometry : ScanGeometry
        The laser.
    settings : object or None
        Its own settings, of the class ``Settings`` of the localizer; the defaults if None.

    Raises
    ------
    ValueError
        If the name is unknown.
    """
    localizer = LOCALIZERS[name]
    return localizer(localizer.Settings() if settings is None else settings, geometry)
