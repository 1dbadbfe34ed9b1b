"""Occupancy maps as files: the map format of ROS (an image with a YAML header), and plain grey images.

Thresholds of a header, or the middle of black and white, often take the grey of unknown cells for free: nav2
writes unknown as 205 with a ``free_thresh`` of 0.25, other mappers write 204, 206, 127 or 128. Such a grey
stands alone: hardly any pixel has a neighbouring grey, and free cells are brighter.

References
----------
ROS map_server (interpretation of pixels: trinary, scale, raw), http://wiki.ros.org/map_server.
"""

import logging
import math
import os
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path, PureWindowsPath
from typing import Any, Literal

import numpy as np
import yaml
from numpy.typing import NDArray

from lidarium.mapping.files.guarded_reading import read_text, reading, shortened
from lidarium.mapping.files.images import IMAGE_SUFFIXES, read_image
from lidarium.mapping.files.output import write_whole
from lidarium.mapping.geometry.bounds import Rule, shown, within

OCCUPIED, UNKNOWN, FREE = 0, 127, 255
_BLOCK_PIXELS = 1 << 20


def _shades(pixels: NDArray[Any]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the mean of the colour channels in 0..255 and the opacity in 0..1."""
    scaled = pixels.astype(np.float64) * (255.0 / np.iinfo(pixels.dtype).max)
    if scaled.ndim == 2:
        return scaled, np.ones((1, 1))
    if _has_alpha(pixels):
        return scaled[..., :-1].mean(axis=2), scaled[..., -1] / 255.0
    return scaled.mean(axis=2), np.ones((1, 1))


def _has_alpha(pixels: NDArray[Any]) -> bool:
    return pixels.ndim == 3 and pixels.shape[2] in (2, 4)


_Alpha = Literal["ignored", "unknown", "averaged"]


def _levels_by_blocks(
    pixels: NDArray[Any], rule: Callable[[NDArray[np.float64]], NDArray[np.uint8]], alpha: _Alpha
) -> NDArray[np.uint8]:
    """Return the levels of pixels by a rule for shades, block by block, as shades take much memory.

    ``alpha`` says what opacity does: nothing, or it makes unknown what is not opaque, or it counts as a fourth colour.
    """
    levels = np.empty(pixels.shape[:2], np.uint8)
    rows = max(_BLOCK_PIXELS // max(pixels.shape[1], 1), 1)
    for row in range(0, len(pixels), rows):
        shades, opacity = _shades(pixels[row : row + rows])
        if alpha == "averaged" and _has_alpha(pixels):
            shades = 0.25 * (3.0 * shades + 255.0 * opacity)
        levels[row : row + rows] = rule(shades)
        if alpha == "unknown":
            levels[row : row + rows][np.broadcast_to(opacity < 1.0, shades.shape)] = UNKNOWN
    return levels


def _levels_of(
    shades: NDArray[np.float64], *, negate: bool, low: float, high: float, unknown: float | None = None
) -> NDArray[np.uint8]:
    """Return the levels of shades in trinary mode: below and above the thresholds.

    ``unknown`` is a grey that stands for it whatever the thresholds.
    """
    occupancy = (shades if negate else 255.0 - shades) / 255.0
    levels = np.full(shades.shape, UNKNOWN, dtype=np.uint8)
    levels[occupancy > high] = OCCUPIED
    levels[occupancy < low] = FREE
    if unknown is not None:
        levels[np.abs(shades - unknown) < 0.5] = UNKNOWN
    return levels


def _raw_levels(shades: NDArray[np.float64], low: float, high: float) -> NDArray[np.uint8]:
    """Read pixels as occupancy in percent; above 100 is unknown."""
    levels = np.full(shades.shape, UNKNOWN, dtype=np.uint8)
    levels[(shades > high * 100.0) & (shades <= 100.0)] = OCCUPIED
    levels[shades < low * 100.0] = FREE
    return levels


MAX_YAML_BYTES = 1 << 14
"""Longest header, some fifty times the usual one: parsing takes long."""


class _PlainLoader(yaml.SafeLoader):
    """Loads values alone: an alias could stand for more than there is memory for."""

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:  # noqa: ANN401
        if self.check_event(yaml.events.AliasEvent):
            raise ValueError("it has an alias (*); want values alone")
        return super().compose_node(parent, index)


def _read_yaml(path: Path) -> Any:  # noqa: ANN401
    """Read a header."""
    text = read_text(path, MAX_YAML_BYTES)
    with reading(path, "a yaml file"):
        try:
            return yaml.load(text, _PlainLoader)
        except yaml.YAMLError as error:
            raise ValueError(str(error)) from error


MAP_SERVER_GREYS = range(204, 207)
MIDDLE_GREYS = range(126, 130)
ALONE = 10
"""Minimum ratio of the pixels of the grey to those of its neighbouring greys."""

MIN_SHARE = 1e-3
"""Least share of the pixels that have it."""

BRIGHTER = 8
"""Minimum difference by which free cells are brighter."""


def unknown_grey(pixels: NDArray[Any], candidates: tuple[range, ...]) -> int | None:
    """Return the grey that means unknown, or None.

    Parameters
    ----------
    pixels : (rows, columns) or (rows, columns, channels) uint8 or uint16
        The picture; its first channel counts.
    """
    grey = pixels if pixels.ndim == 2 else pixels[..., 0]
    eight = grey if grey.dtype == np.uint8 else (grey // 257).astype(np.uint8)
    counts = np.bincount(eight.ravel(), minlength=256)
    for greys in candidates:
        likeliest = max(greys, key=lambda level: counts[level])
        beside = int(counts[likeliest - 3 : likeliest + 4].sum() - counts[likeliest])
        is_alone = counts[likeliest] > max(ALONE * beside, MIN_SHARE * counts.sum())
        if is_alone and counts[likeliest + BRIGHTER :].sum() > 0:
            return int(likeliest)
    return None


RESOLUTION = Rule(float, bounds=within(1e-4, 100.0, "a positive number"))
"""Allowed sides of a cell [m]."""

MAX_COORDINATE_M = 1e8
"""Farthest that a map may lie from the origin of its frame [m]."""

_LOG = logging.getLogger(__name__)
_ALPHA_OF_MODES: dict[str, _Alpha] = {"trinary": "averaged", "scale": "unknown", "raw": "ignored"}
"""How map_server treats opacity in each mode."""

_REQUIRED = ("image", "resolution", "origin", "negate", "occupied_thresh", "free_thresh")
_PGM_LEVELS = {OCCUPIED: 0, UNKNOWN: 205, FREE: 254}


@dataclass(frozen=True, slots=True, eq=False)
class MapImage:
    """An occupancy map of three levels.

    Attributes
    ----------
    levels : (rows, columns) uint8
        0 occupied, 127 unknown, 255 free; row 0 at the lowest y of the map's own axes.
    origin : (x, y, yaw)
        Pose of the lower left corner of cell (0, 0) [m, rad].
    resolution : float
        Side of a cell [m].
    """

    levels: NDArray[np.uint8]
    origin: tuple[float, float, float]
    resolution: float


def read_ros_map(yaml_path: Path | str) -> MapImage:
    """Read an occupancy map of ROS map_server.

    Parameters
    ----------
    yaml_path : Path or str
        The yaml file; its image is in the same folder.

    Returns
    -------
    MapImage
        The map. In scale and raw mode too, cells between the thresholds are unknown. In trinary mode the
        grey that map_saver writes for unknown is unknown whatever the thresholds, and opacity counts as a fourth
        colour, as in map_server: transparent white is unknown.

    Raises
    ------
    FileNotFoundError
        If the yaml file or its image is not there.
    ValueError
        If a key is missing or has a bad value, or the image cannot be read.

    Examples
    --------
    >>> import lidarium, numpy as np, tempfile
    >>> levels = np.array([[0, 127], [255, 255]], np.uint8)
    >>> file = lidarium.write_map(tempfile.mkdtemp(), "map", levels, (0.0, 0.0, 0.0), 0.05)
    >>> lidarium.read_map(file).levels.tolist()
    [[0, 127], [255, 255]]
    """
    yaml_path = Path(yaml_path)
    header = _read_header(yaml_path)
    pixels = read_image(_image_path(yaml_path, str(header["image"])))
    low, high = _number(yaml_path, header, "free_thresh"), _number(yaml_path, header, "occupied_thresh")
    if not 0.0 <= low < high <= 1.0:
        raise ValueError(
            f"{yaml_path}: free_thresh is {low} and occupied_thresh {high}; want 0 <= free_thresh < "
            "occupied_thresh <= 1"
        )
    mode = str(header.get("mode", "trinary"))
    if mode not in _ALPHA_OF_MODES:
        raise ValueError(f"{yaml_path}: mode is {shown(mode)}; want one of {', '.join(_ALPHA_OF_MODES)}")
    negate = bool(_number(yaml_path, header, "negate"))
    # map_saver of nav2 writes unknown as 205, which its free_thresh of 0.25 calls free.
    may_mistake = mode == "trinary" and not negate
    unknown: float | None = unknown_grey(pixels, (MAP_SERVER_GREYS,)) if may_mistake else None
    if unknown is not None and _has_alpha(pixels):
        unknown = 0.25 * (3.0 * unknown + 255.0)  # of opaque pixels
    rule = _raw_levels if mode == "raw" else partial(_levels_of, negate=negate, unknown=unknown)
    levels = _levels_by_blocks(pixels, lambda shades: rule(shades, low=low, high=high), _ALPHA_OF_MODES[mode])
    return MapImage(np.ascontiguousarray(levels[::-1]), _origin(yaml_path, header), _resolution(yaml_path, header))


def read_grey_map(path: Path, resolution: float) -> MapImage:
    """Read a plain image as a map.

    Black is occupied, white is free, and values between are unknown, as is the grey that mappers write for unknown.

    Parameters
    ----------
    resolution : float
        Side of a cell [m].
    """
    if not RESOLUTION.hold(resolution):
        raise ValueError(f"{path}: resolution is {resolution} m; want {RESOLUTION.wanted}")
    pixels = read_image(Path(path))
    unknown = unknown_grey(pixels, (MAP_SERVER_GREYS, MIDDLE_GREYS))
    rule = partial(_levels_of, negate=False, low=0.196, high=0.65, unknown=unknown)
    levels = _levels_by_blocks(pixels, rule, "unknown")
    return MapImage(np.ascontiguousarray(levels[::-1]), (0.0, 0.0, 0.0), resolution)


def write_ros_map(
    folder: Path | str,
    name: str,
    levels: NDArray[np.uint8],
    origin: tuple[float, float, float],
    resolution: float,
) -> Path:
    """Write an occupancy map for ROS map_server: ``name.yaml`` and ``name.pgm``.

    Both files are written under temporary names and then renamed, the yaml last, so that a reader never finds
    half a map.

    Parameters
    ----------
    folder : Path or str
        Folder to write to; made if it does not exist.
    name : str
        Stem of both files.
    levels : (rows, columns) uint8
        0 occupied, 127 unknown, 255 free; row 0 at the lowest y.
    origin : (x, y, yaw)
        Pose of the lower left corner [m, rad].
    resolution : float
        Side of a cell [m].

    Returns
    -------
    Path
        The yaml file.

    Raises
    ------
    ValueError
        If a level is none of the three, the map is empty, or origin or resolution are not finite.

    Examples
    --------
    >>> import lidarium, numpy as np, tempfile
    >>> levels = np.full((40, 60), 255, np.uint8)  # 2 m x 3 m of free floor
    >>> lidarium.write_map(tempfile.mkdtemp(), "room", levels, (0.0, 0.0, 0.0), 0.05).name
    'room.yaml'
    """
    levels = np.asarray(levels)
    if levels.ndim != 2 or levels.size == 0:
        raise ValueError(f"map {name!r} has shape {levels.shape}; want rows and columns")
    if not np.isin(levels, list(_PGM_LEVELS)).all():
        raise ValueError(
            f"map {name!r} has levels {np.unique(levels)[:6]}; want only {OCCUPIED} occupied, {UNKNOWN} "
            f"unknown, {FREE} free"
        )
    if len(origin) != 3 or not (np.abs(origin) <= MAX_COORDINATE_M).all():
        raise ValueError(
            f"map {name!r} has origin {origin}; want (x, y, yaw) in metres and radians, {MAX_COORDINATE_M:,.0f} at most"
        )
    if not RESOLUTION.hold(resolution):
        raise ValueError(f"map {name!r} has a resolution of {resolution} m; want {RESOLUTION.wanted}")
    table = np.zeros(256, dtype=np.uint8)
    for level, grey in _PGM_LEVELS.items():
        table[level] = grey
    pixels = table[levels[::-1].astype(np.uint8)]
    header = {
        "image": f"{name}.pgm",
        "mode": "trinary",
        "resolution": float(resolution),
        "origin": [float(value) for value in origin],
        "negate": 0,
        "occupied_thresh": 0.65,
        "free_thresh": 0.196,
    }
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    write_whole(folder / f"{name}.pgm", f"P5\n{pixels.shape[1]} {pixels.shape[0]}\n255\n".encode() + pixels.tobytes())
    write_whole(folder / f"{name}.yaml", yaml.safe_dump(header, sort_keys=False).encode())
    return folder / f"{name}.yaml"


def cropped(
    levels: NDArray[np.uint8], origin: tuple[float, float], resolution: float, margin: int = 4
) -> tuple[NDArray[np.uint8], tuple[float, float]]:
    """Return the known part of a map and its lower left corner [m].

    The part includes a margin [cells] if the map has one.

    Parameters
    ----------
    levels : (rows, columns) uint8
        0 occupied, 127 unknown, 255 free; row 0 at the lowest y.
    origin : (x, y)
        Lower left corner [m].
    resolution : float
        Side of a cell [m].
    """
    is_known = levels != UNKNOWN
    if not is_known.any():
        return levels, origin
    rows, columns = np.flatnonzero(is_known.any(axis=1)), np.flatnonzero(is_known.any(axis=0))
    row, column = max(int(rows[0]) - margin, 0), max(int(columns[0]) - margin, 0)
    part = levels[row : int(rows[-1]) + 1 + margin, column : int(columns[-1]) + 1 + margin]
    return np.ascontiguousarray(part), (origin[0] + column * resolution, origin[1] + row * resolution)


def _read_header(path: Path) -> dict[str, Any]:
    if path.suffix.lower() in IMAGE_SUFFIXES:
        raise ValueError(f"{path} is an image; want the yaml file of a ROS map, or load_floor for a plain image")
    header = _read_yaml(path)
    if not isinstance(header, dict):
        raise ValueError(f"{path} has no keys; want the yaml file of a ROS map with {', '.join(_REQUIRED)}")
    missing = [key for key in _REQUIRED if key not in header]
    if missing:
        raise ValueError(f"{path} has no key {', '.join(missing)}; a ROS map has {', '.join(_REQUIRED)}")
    return header


def image_of(path: Path) -> Path | None:
    """Return the path of the image of a ROS map, None if the file is not a readable yaml of a map."""
    if path.suffix.lower() not in (".yaml", ".yml"):
        return None
    try:
        name = str(_read_header(path)["image"])
    except (OSError, ValueError):
        return None
    named = path.parent / name
    return named if named.exists() else path.parent / PureWindowsPath(name).name


def _image_path(yaml_path: Path, name: str) -> Path:
    """Return the path of the image of a map.

    If the header names a path that does not exist, the file of that name in the folder of the header is used, with
    a warning to the log.
    """
    named = yaml_path.parent / name
    beside = yaml_path.parent / PureWindowsPath(name).name
    if named != beside and not os.path.isfile(named) and os.path.isfile(beside):
        _LOG.warning("%s: there is no image %s; %s beside it is used", yaml_path, name, beside.name)
        return beside
    if not os.path.lexists(named):
        short = shortened(str(named), 200)
        raise FileNotFoundError(f"there is no file {short}; {yaml_path} names it as its image: put the image beside it")
    return named


def _number(path: Path, header: dict[str, Any], key: str) -> float:
    try:
        value = float(header[key])
    except (TypeError, ValueError, OverflowError):
        value = math.nan
    if not math.isfinite(value):
        raise ValueError(f"{path}: {key} is {shown(header[key])}; want a number")
    return value


def _resolution(path: Path, header: dict[str, Any]) -> float:
    resolution = _number(path, header, "resolution")
    if not RESOLUTION.hold(resolution):
        raise ValueError(f"{path}: resolution is {resolution} m; want {RESOLUTION.wanted}")
    return resolution


def _origin(path: Path, header: dict[str, Any]) -> tuple[float, float, float]:
    try:
        x, y, yaw = (float(value) for value in header["origin"])
    except (TypeError, ValueError, OverflowError):
        x = y = yaw = math.nan
    if not (np.isfinite([x, y, yaw]).all() and max(abs(x), abs(y), abs(yaw)) <= MAX_COORDINATE_M):
        raise ValueError(
            f"{path}: origin is {shown(header['origin'])}; want [x, y, yaw] in metres and radians, "
            f"{MAX_COORDINATE_M:,.0f} at most"
        )
    return x, y, yaw
