"""Worlds of Stage: a picture of the walls with its size and pose, and robots.

References
----------
R. Vaughan, "Massively multi-robot simulation in Stage", Swarm Intelligence 2, 2008; libstage, worldfile.cc and
`rotrects_from_image_file` (what is white around the walls is trimmed before the picture is scaled).
"""

import math
import os
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path, PureWindowsPath
from typing import Any

import cv2
import numpy as np

from lidarium.envs.floors.floor import Floor
from lidarium.envs.floors.importers.common import read_text, refuse_resolution
from lidarium.envs.floors.importers.ros_map import floor_of_map
from lidarium.mapping.files.guarded_reading import encoding_of, open_guarded, printable
from lidarium.mapping.files.images import MAX_PIXELS, read_image
from lidarium.mapping.files.map_files import FREE, OCCUPIED, RESOLUTION, MapImage
from lidarium.mapping.geometry.bounds import shown

SUFFIXES = (".world",)

_SOLID_BELOW = 127
_DEEPEST = 16
_ROBOT = "position"
_TOKENS = re.compile(r'#[^\n]*|"([^"\n]*)"|([()\[\]])|([^\s()\[\]"#]+(?:\[\d+\])?)')


@dataclass(slots=True)
class _Model:
    """A model of a world: its type, its properties, and the models on it."""

    kind: str
    properties: dict[str, list[str]] = field(default_factory=dict)


def matches(path: Path) -> bool:
    """Return whether a world is not XML, as Gazebo's are."""
    with open_guarded(path) as file:
        begin = file.read(4096)
    text = begin.decode(encoding_of(begin), "ignore").strip()
    return bool(text) and not text.startswith("<")


def load(path: Path, resolution: float | None) -> Floor:
    """Read a world with one picture of walls; the poses of its robots are starts."""
    refuse_resolution(path, resolution)
    defined: dict[str, _Model] = {}
    models = list(_models(path, _words(path), defined, 0))
    drawn = [model for model in models if "bitmap" in model.properties]
    if len(drawn) != 1:
        raise ValueError(
            f"{path} is a world of Stage with {len(drawn)} models of a bitmap; want one, or a picture and --resolution"
        )
    robots = [model for model in models if _is_robot(model.kind, defined) and "pose" in model.properties]
    starts = np.array([_pose(path, model) for model in robots]).reshape(-1, 3)
    return floor_of_map(path, _map_of(path, drawn[0]), starts)


def _map_of(path: Path, model: _Model) -> MapImage:
    """Return the picture of a model as a map."""
    name = model.properties["bitmap"][0]
    picture = path.parent / name
    if not os.path.isfile(picture):
        picture = path.parent / PureWindowsPath(name).name
    pixels = read_image(picture)
    # Stage looks at the first channel of RGB, which is the last one here.
    first = pixels if pixels.ndim == 2 else pixels[..., min(pixels.shape[2] - 1, 2)]
    is_solid = first < (_SOLID_BELOW if first.dtype == np.uint8 else _SOLID_BELOW * 257)
    rows, columns = np.flatnonzero(is_solid.any(axis=1)), np.flatnonzero(is_solid.any(axis=0))
    if not len(rows):
        raise ValueError(f"{picture} has no dark pixels; want a picture of walls")
    is_solid = is_solid[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    size = _values(path, model, "size", (2, 3))[:2]
    sides = size[0] / is_solid.shape[1], size[1] / is_solid.shape[0]
    side = min(sides)
    if not all(RESOLUTION.hold(each) for each in sides) or size[0] * size[1] / side**2 > MAX_PIXELS:
        raise ValueError(f"{path} has pixels of {sides[0]:g} x {sides[1]:g} m; want {RESOLUTION.wanted}")
    if "boundary" in model.properties and model.properties["boundary"][:1] == ["1"]:
        is_solid[[0, -1]] = is_solid[:, [0, -1]] = True
    shape = round(size[0] / side), round(size[1] / side)
    solid = cv2.resize(is_solid.astype(np.uint8), shape, interpolation=cv2.INTER_NEAREST)
    levels = np.where(solid[::-1] != 0, np.uint8(OCCUPIED), np.uint8(FREE))
    x, y, yaw = _pose(path, model) if "pose" in model.properties else (0.0, 0.0, 0.0)
    cosine, sine = math.cos(yaw), math.sin(yaw)
    half_x, half_y = size[0] / 2.0, size[1] / 2.0
    corner = x - cosine * half_x + sine * half_y, y - sine * half_x - cosine * half_y
    return MapImage(levels, (*corner, yaw), side)


def _pose(path: Path, model: _Model) -> tuple[float, float, float]:
    """Return x, y and heading of a model [m, rad]; the file has degrees, and in new worlds a height before them."""
    values = _values(path, model, "pose", (3, 4))
    return values[0], values[1], math.radians(values[-1])


def _values(path: Path, model: _Model, name: str, counts: tuple[int, ...]) -> list[float]:
    words = model.properties.get(name, [])
    try:
        found = [float(word) for word in words]
    except ValueError:
        found = []
    if len(found) not in counts or not np.isfinite(found).all():
        wanted = " or ".join(map(str, counts))
        given = shown(" ".join(words))
        raise ValueError(f"{path}: {printable(model.kind)} has the {name} {given}; want {wanted} numbers")
    return found


def _is_robot(kind: str, defined: dict[str, _Model]) -> bool:
    for _ in range(_DEEPEST):
        if kind == _ROBOT or kind not in defined:
            break
        kind = defined[kind].kind
    return kind == _ROBOT


def _words(path: Path) -> Iterator[str]:
    """Yield the words of a world; brackets are words, comments are not."""
    for found in _TOKENS.finditer(read_text(path)):
        quoted, bracket, word = found.groups()
        if quoted is not None:
            yield quoted
        elif bracket or word:
            yield bracket or word


def _models(path: Path, words: Iterator[str], defined: dict[str, _Model], depth: int) -> Iterator[_Model]:
    """Yield the models of a world; what it defines is added, also by files that it includes and that are there."""
    if depth > _DEEPEST:
        raise ValueError(f"{path} includes files more than {_DEEPEST} deep; want a world")
    for word in words:
        if word == "include":
            name = next(words, "")
            file = path.parent / name
            if ".." not in Path(name).parts and os.path.isfile(file):
                yield from _models(file, _words(file), defined, depth + 1)
        elif word == "define":
            name, kind = next(words, ""), next(words, "")
            if next(words, "") != "(":
                raise ValueError(f"{path} defines {shown(name)} without brackets; want a world of Stage")
            defined[name] = _model(path, kind, words, defined, 0)
        else:
            following = next(words, "")
            if following == "(":
                yield _model(path, word, words, defined, 0)
            elif following == "[":
                _listed(path, words)


def _model(path: Path, kind: str, words: Iterator[str], defined: dict[str, _Model], depth: int) -> _Model:
    """Return the model whose properties begin; those of its definition are its own unless it has others."""
    if depth > _DEEPEST:
        raise ValueError(f"{path} has models nested more than {_DEEPEST} deep; want a world")
    model = _Model(kind, dict(defined[kind].properties) if kind in defined else {})
    for word in words:
        if word == ")":
            return model
        following = next(words, "")
        if following == "(":
            _model(path, word, words, defined, depth + 1)
        else:
            model.properties[word] = _listed(path, words) if following == "[" else [following]
    raise ValueError(f"{path} ends within {shown(kind)}; want a whole world of Stage, or one of Gazebo")


def _listed(path: Path, words: Iterator[str]) -> list[str]:
    found: list[Any] = []
    for word in words:
        if word == "]":
            return found
        found.append(word)
    raise ValueError(f"{path} ends within brackets; want a whole world of Stage, or one of Gazebo")
