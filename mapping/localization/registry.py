"""The localizers by name."""

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module

from lidarium.mapping.localization.localizer import Localizer
from lidarium.mapping.scans import ScanGeometry


@dataclass(frozen=True, slots=True)
class Entry:
    """A localizer that can be chosen by name.

    Attributes
    ----------
    description : str
        What it does, in a line.
    factory : str
        Module and name of what makes one from the geometry of the laser's scans: ``module:name``.
    """

    description: str
    factory: str


LOCALIZERS: dict[str, Entry] = {}
"""The localizers by name; their modules are imported when they are first made."""


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
    module, _, made_by = LOCALIZERS[name].factory.partition(":")
    factory: Callable[[ScanGeometry], Localizer] = getattr(import_module(module), made_by)
    return factory(geometry)
