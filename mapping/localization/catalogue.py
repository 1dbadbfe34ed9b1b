"""The localizers by name."""

from collections.abc import Callable
from dataclasses import dataclass

from lidarium.mapping.localization.localizer import Localizer
from lidarium.mapping.localization.odometry import Odometry
from lidarium.mapping.localization.settings import SlamSettings
from lidarium.mapping.localization.slam import Slam
from lidarium.mapping.scans import ScanGeometry


@dataclass(frozen=True, slots=True)
class LocalizerKind:
    """A kind of localizer.

    Attributes
    ----------
    name, line : str
        What it is called, and what it is in a line.
    make : callable
        Makes one for a lidar and a seed; one for each robot.
    """

    name: str
    line: str
    make: Callable[[ScanGeometry, int], Localizer]


def _odometry(geometry: ScanGeometry, seed: int) -> Localizer:
    return Odometry()


def _slam(geometry: ScanGeometry, seed: int) -> Localizer:
    return Slam(SlamSettings(), geometry)


LOCALIZERS = {
    kind.name: kind
    for kind in (
        LocalizerKind("odometry", "dead reckoning from the start", _odometry),
        LocalizerKind("slam", "scans matched with local maps, places recognised, the past corrected", _slam),
    )
}


def localizer(name: str, geometry: ScanGeometry, seed: int = 0) -> Localizer:
    """Make a localizer for one robot.

    Raises
    ------
    ValueError
        Where there is none of that name.
    """
    if name not in LOCALIZERS:
        raise ValueError(f"localizer is {name!r}; want one of {', '.join(LOCALIZERS)}")
    return LOCALIZERS[name].make(geometry, seed)
