"""Importers of floors, one module per format."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lidarium.envs.floors.floor import Floor
from lidarium.envs.floors.importers import (
    amrl,
    arrays,
    dxf,
    houseexpo,
    images,
    kth,
    lifull,
    movingai,
    ros_map,
    sdf,
    stage,
    svg,
)
from lidarium.mapping.files.guarded_reading import check_file, reading
from lidarium.mapping.files.map_files import RESOLUTION
from lidarium.mapping.geometry.bounds import shown
from lidarium.registry import Registry


@dataclass(frozen=True, slots=True)
class Format:
    """A file format of floors.

    Attributes
    ----------
    suffixes : tuple of str
        Suffixes of its files.
    matches : callable
        Whether a file with such a name is of this format, by its content.
    load : callable
        Reads the file; gets the path, the resolution asked for or None, and its options by keyword.
    has_scale : callable
        Whether a file states its scale, by its name.
    options : tuple of str
        Names of further options of `load`.
    """

    suffixes: tuple[str, ...]
    matches: Callable[[Path], bool]
    load: Callable[..., Floor]
    has_scale: Callable[[Path], bool] = lambda path: True
    options: tuple[str, ...] = ()


def _always(path: Path) -> bool:
    return True


FORMATS: Registry[Format] = Registry("floor format")
"""Formats of floors by name; the first that matches reads a file."""

FORMATS.register("ros_map", Format(ros_map.SUFFIXES, _always, ros_map.load), "ROS map: a picture with its yaml")
FORMATS.register("houseexpo", Format((".json", ".json.gz"), _always, houseexpo.load), "HouseExpo, a plan as JSON")
FORMATS.register("kth", Format((".xml", ".xml.gz"), _always, kth.load), "KTH floor plan as XML")
FORMATS.register("amrl", Format((".txt", ".txt.gz"), amrl.matches, amrl.load), "AMRL vector map")
FORMATS.register("lifull", Format((".txt", ".txt.gz"), lifull.matches, lifull.load), "LIFULL vector annotation")
FORMATS.register(
    "movingai",
    Format((".map", ".map.gz"), movingai.matches, movingai.load, movingai.has_scale),
    "MovingAI grid map",
)
FORMATS.register("dxf", Format((".dxf",), _always, dxf.load, dxf.has_scale, ("layers",)), "DXF drawing")
FORMATS.register("stage", Format(stage.SUFFIXES, stage.matches, stage.load), "world of Stage with its picture")
FORMATS.register("sdf", Format(sdf.SUFFIXES, _always, sdf.load, options=("skip_meshes",)), "SDF, a world of Gazebo")
FORMATS.register("svg", Format((".svg",), _always, svg.load, svg.has_scale), "SVG drawing")
FORMATS.register("array", Format((".npy", ".npz"), _always, arrays.load, arrays.has_scale), "numpy array")
FORMATS.register("dungeon", Format(images.SUFFIXES, images.is_dungeon, images.load_dungeon), "picture of a dungeon")
FORMATS.register(
    "image",
    Format(images.SUFFIXES, _always, images.load_image, has_scale=lambda path: False),
    "plain picture",
)


def load_file(path: Path, resolution: float | None = None, **options: Any) -> Floor:  # noqa: ANN401
    """Read a floor from a file of any known format.

    The format is recognised by the file's name and content.

    Parameters
    ----------
    resolution : float or None
        Side of a pixel [m] if the file does not state it: needed for plain images, numpy arrays,
        grid maps and drawings.
    options
        Options of the format, as ``skip_meshes`` of worlds and ``layers`` of DXF drawings.
    """
    path = Path(path)
    check_file(path)
    if resolution is not None and not RESOLUTION.hold(resolution):
        raise ValueError(f"resolution is {shown(resolution)} m; want {RESOLUTION.wanted} of metres per pixel")
    with reading(path, "a floor"):
        known = _format_of(path)
        if known is not None:
            if unknown := sorted(set(options) - set(known.options)):
                raise ValueError(f"{path} takes no {' or '.join(unknown)}; want {', '.join(known.options) or 'none'}")
            return known.load(path, resolution, **options)
    raise _no_floor(path)


def check_floor_file(path: Path) -> None:
    """Check that a file is there and of a known format; it is not loaded."""
    check_file(path)
    if not is_floor(path):
        raise _no_floor(path)


def _no_floor(path: Path) -> ValueError:
    """Return the error of a file that is of no known format."""
    if by_name := [name for name, known in FORMATS.items() if path.name.lower().endswith(known.suffixes)]:
        return ValueError(f"{path} has the content of no known floor format; want {' or '.join(by_name)}")
    suffixes = sorted({suffix for known in FORMATS.values() for suffix in known.suffixes})
    return ValueError(f"{path} is of no known floor format; want a file that ends in {', '.join(suffixes)}")


def takes_resolution(path: Path) -> bool:
    """Whether a file needs a resolution in addition, because it does not state its scale."""
    with reading(path, "a floor"):
        known = _format_of(path)
        return known is not None and not known.has_scale(path)


def is_floor(path: Path) -> bool:
    """Whether a file is a floor of a known format, by its name and content."""
    with reading(path, "a floor"):
        return _format_of(path) is not None


def _format_of(path: Path) -> Format | None:
    """Return the first format that a file's name and content match."""
    lower = path.name.lower()
    return next((known for known in FORMATS.values() if lower.endswith(known.suffixes) and known.matches(path)), None)
