"""Plans as SVG drawings: what is dark is solid, as in a picture, but at the drawing's own precision.

Lines are as wide as they are drawn, and at least so wide that nothing leaks through them.
"""

import functools
import itertools
import math
import operator
import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.floors.drawing import fill_shapes, ring_edges, strip_edges
from lidarium.envs.floors.extent import check_extent
from lidarium.envs.floors.floor import Floor
from lidarium.envs.floors.importers.common import few_enough, floor_of_cells, read_text
from lidarium.envs.floors.importers.svg_paths import Polyline, length, outlines, transform_of
from lidarium.mapping.files.images import MOST_PIXELS
from lidarium.mapping.geometry.bounds import shown

RESOLUTION = 0.025
LEAST_WIDTH = 0.05
"""Least width of a line [m]."""

_MARGIN = 0.5
_FREE_ABOVE = 127 / 255
_DEEPEST = 64
_UNSEEN = frozenset(
    (
        "defs",
        "symbol",
        "clipPath",
        "mask",
        "marker",
        "pattern",
        "metadata",
        "title",
        "desc",
        "style",
        "script",
        "text",
    )
)
_OF_STYLE = ("fill", "stroke", "stroke-width", "display", "visibility")
_HAS_STYLE = frozenset(("class", "style", *_OF_STYLE))
_DEFAULTS = {
    "fill": "black",
    "stroke": "none",
    "stroke-width": "1",
    "display": "inline",
    "visibility": "visible",
}
_RULES = re.compile(r"([^{}]+)\{([^{}]*)\}")

Style = dict[str, str]


_Layer = tuple[int, NDArray[np.float64] | None, NDArray[np.float64], float]
"""Paint: 1 for solid, 0 for free; edges of an inside; lines (N, 4) with their width [m]."""

_VALUE: Callable[[_Layer], int] = operator.itemgetter(0)


@dataclass(frozen=True, slots=True, eq=False)
class _Shape:
    """A shape of a drawing in metres, y up; what is none is not painted."""

    outlines: list[Polyline]
    is_solid_inside: bool | None
    is_solid_line: bool | None
    width: float


def has_scale(path: Path) -> bool:
    """Return False: a drawing does not say how large what it shows is."""
    return False


def load(path: Path, resolution: float | None) -> Floor:
    """Read a drawing of which a unit is ``resolution`` long [m], in cells of 0.025 m."""
    if resolution is None:
        raise ValueError(f"{path} does not say how large it is; give --resolution, the metres of a unit")
    try:
        root = ElementTree.fromstring(read_text(path))
    except ElementTree.ParseError as error:
        raise ValueError(f"{path} is not XML: {error}") from error
    if _kind(root) != "svg":
        raise ValueError(f"{path} begins with {shown(_kind(root))}; want an svg element")
    to_metres = np.diag([resolution, -resolution, 1.0])
    found = _shapes(root, to_metres, dict(_DEFAULTS), _classes(root), 0)
    shapes = list(few_enough(path, found, lambda shape: sum(map(len, shape.outlines))))
    drawn = [shape for shape in shapes if shape.is_solid_line or shape.is_solid_inside]
    if not drawn:
        raise ValueError(f"{path} has no dark lines or areas; want a plan whose walls are dark")
    rings = [outline for shape in drawn for outline in shape.outlines]
    points = np.concatenate(rings)
    low, high = points.min(axis=0) - _MARGIN, points.max(axis=0) + _MARGIN
    check_extent(str(path), (*low.tolist(), *high.tolist()), rings)
    columns, rows = (int(size) + 1 for size in (high - low) / RESOLUTION)
    if rows * columns > MOST_PIXELS:
        raise ValueError(
            f"{path} has {columns} x {rows} cells at {RESOLUTION} m, more than {MOST_PIXELS:,}; give "
            "a smaller --resolution"
        )
    solid, origin = np.zeros((rows, columns), np.uint8), (float(low[0]), float(low[1]))
    # One over the other, as they are painted; those of one colour at once.
    for value, layers in itertools.groupby(itertools.chain.from_iterable(map(_layers, shapes)), _VALUE):
        _, insides, lines, widths = zip(*layers, strict=True)
        fill_shapes(solid, origin, RESOLUTION, [each for each in insides if each is not None], value)
        segments = np.concatenate(lines)
        of_segments = np.repeat(widths, [len(each) for each in lines])
        fill_shapes(solid, origin, RESOLUTION, strip_edges(segments, of_segments, 0.5), value)
    return floor_of_cells(path, solid == 0, origin, RESOLUTION)


def _layers(shape: _Shape) -> Iterator[_Layer]:
    """Yield what a shape paints: its inside first, then its line."""
    if shape.is_solid_inside is not None:
        rings = [ring_edges(outline) for outline in shape.outlines if len(outline) > 2]
        if rings:
            yield int(shape.is_solid_inside), np.concatenate(rings), np.zeros((0, 4)), 0.0
    if shape.is_solid_line is not None:
        width = max(shape.width, LEAST_WIDTH) if shape.is_solid_line else shape.width
        segments = [np.hstack([line[:-1], line[1:]]) for line in shape.outlines]
        yield int(shape.is_solid_line), None, np.concatenate(segments), width


def _shapes(
    element: Element, around: NDArray[np.float64], inherited: Style, classes: dict[str, Style], depth: int
) -> Iterator[_Shape]:
    """Yield the shapes of an element and of all within it, in the order in which they are painted."""
    kind = _kind(element)
    if kind in _UNSEEN:
        return
    if depth > _DEEPEST:
        raise ValueError(f"elements are nested more than {_DEEPEST} deep; want a plan")
    style = _style(element, inherited, classes)
    if style["display"].strip() == "none":
        return
    matrix = around @ transform_of(element) if "transform" in element.attrib else around
    found = outlines(element, kind)
    if found and style["visibility"].strip() == "visible":
        placed = [outline @ matrix[:2, :2].T + matrix[:2, 2] for outline in found]
        (a, b), (c, d) = matrix[:2, :2].tolist()
        scale = math.sqrt(abs(a * d - b * c))
        yield _Shape(
            placed,
            None if kind == "line" else _is_dark(style["fill"]),
            _is_dark(style["stroke"]),
            length(style["stroke-width"], 1.0) * scale,
        )
    for child in element:
        yield from _shapes(child, matrix, style, classes, depth + 1)


def _kind(element: Element) -> str:
    """Return the name of an element without its name space."""
    return str(element.tag).rpartition("}")[2]


def _style(element: Element, inherited: Style, classes: dict[str, Style]) -> Style:
    """Return the style of an element.

    Its own goes before those of its classes, these before its attributes, these before what is inherited.
    """
    if not classes and _HAS_STYLE.isdisjoint(element.attrib):
        return inherited
    style = {**inherited, **{name: value for name in _OF_STYLE if (value := element.get(name)) is not None}}
    for name in (_kind(element), *(f".{each}" for each in element.get("class", "").split())):
        style |= classes.get(name, {})
    style |= _declared(element.get("style", ""))
    return {name: inherited[name] if value.strip() == "inherit" else value for name, value in style.items()}


def _classes(root: Element) -> dict[str, Style]:
    """Return the rules of style sheets whose selector is a class or the name of an element."""
    sheets = "".join("".join(each.itertext()) for each in root.iter() if _kind(each) == "style")
    rules: dict[str, Style] = {}
    for selectors, text in _RULES.findall(re.sub(r"/\*.*?\*/", "", sheets, flags=re.DOTALL)):
        for selector in selectors.split(","):
            rules.setdefault(selector.strip(), {}).update(_declared(text))
    return rules


def _declared(text: str) -> Style:
    pairs = (declaration.partition(":") for declaration in text.split(";"))
    found = {name.strip(): value.replace("!important", "").strip() for name, _, value in pairs}
    return {name: value for name, value in found.items() if name in _OF_STYLE}


@functools.cache
def _is_dark(colour: str) -> bool | None:
    """Return whether a colour is dark; None where nothing is painted. Gradients and their like are dark."""
    from matplotlib.colors import to_rgb

    word = colour.strip().lower()
    if word in ("none", "transparent"):
        return None
    if found := re.fullmatch(r"rgba?\(([^)]*)\)", word):
        parts = [part.strip() for part in re.split(r"[\s,/]+", found[1].strip())]
        levels = [float(part[:-1]) * 2.55 if part.endswith("%") else float(part) for part in parts[:3]]
        red, green, blue = (level / 255.0 for level in levels)
    else:
        try:
            red, green, blue = to_rgb(word)
        except ValueError:
            return True
    return bool(0.299 * red + 0.587 * green + 0.114 * blue <= _FREE_ABOVE)
