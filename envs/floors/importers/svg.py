"""Plans as SVG drawings: dark areas are solid, as in an image, but at the drawing's own precision.

Lines are as wide as they are drawn, and at least so wide that nothing leaks through them.
"""

import itertools
import math
import operator
import re
import xml.etree.ElementTree as ElementTree
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np
from numpy.typing import NDArray
from svgelements import Arc, CubicBezier, Matrix, PathSegment, QuadraticBezier

from lidarium.envs.floors.drawing import fill_shapes, ring_edges, strip_edges
from lidarium.envs.floors.floor import Floor, check_extent
from lidarium.envs.floors.importers.common import MAX_POINTS, few_enough, floor_of_cells, read_text
from lidarium.envs.floors.importers.svg_styles import StyleSheet, declared, light_of, settled, share_of
from lidarium.mapping.files.images import MAX_PIXELS
from lidarium.mapping.geometry.bounds import shown

Polyline = NDArray[np.float64]
"""Points x, y (n, 2) in the drawing's units; closed if the last is the first."""

CURVE_PARTS = 16
"""Straight parts of a curve, and of a quarter of a circle."""

_SHARES = np.arange(1, CURVE_PARTS + 1) / CURVE_PARTS

_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_NUMBERS = re.compile(_NUMBER)
_COMMANDS = re.compile(r"([MmZzLlHhVvCcSsQqTtAa])([^MmZzLlHhVvCcSsQqTtAa]*)")
# Flags are single digits that may be joined with the following number.
_ARCS = re.compile(
    rf"({_NUMBER})[\s,]*({_NUMBER})[\s,]*({_NUMBER})[\s,]*([01])[\s,]*([01])[\s,]*({_NUMBER})[\s,]*({_NUMBER})"
)
_WANTS = {"M": 2, "L": 2, "H": 1, "V": 1, "C": 6, "S": 4, "Q": 4, "T": 2, "A": 7}
_WANTS |= {command.lower(): count for command, count in _WANTS.items()}


def _numbers(text: str) -> list[float]:
    """Return the numbers of a text."""
    return list(map(float, _NUMBERS.findall(text)))


_LENGTH = re.compile(rf"\s*({_NUMBER})\s*([A-Za-z]+|%)?")
_UNITS = {"": 1.0, "px": 1.0, "pt": 96 / 72, "pc": 16.0, "in": 96.0, "cm": 96 / 2.54, "mm": 96 / 25.4}
"""The drawing's units of a unit of length (CSS Values and Units 4, section 6.2)."""

_View = tuple[float, float]
"""Width and height of the part of a drawing of which lengths may be shares, in its units."""


def _length(text: str | None, otherwise: float = 0.0, whole: float = math.nan) -> float:
    """Return a length in the drawing's units; shares are of a whole, which may be unknown (nan)."""
    found = _LENGTH.match(text or "")
    if found is None:
        return otherwise
    unit = (found[2] or "").lower()
    if unit == "%":
        return 0.01 * float(found[1]) * whole
    if unit not in _UNITS:
        raise ValueError(f"a length is {shown(text)}; want one without a unit, or px, pt, pc, in, cm, mm")
    return float(found[1]) * _UNITS[unit]


def _view_within(element: Element, around: _View) -> _View:
    """Return the size that shares of lengths within a drawing or symbol are of."""
    box = _numbers(element.get("viewBox", ""))
    if len(box) == 4:
        return box[2], box[3]
    wide, high = (
        _length(element.get(name), whole, whole) for name, whole in zip(("width", "height"), around, strict=True)
    )
    return wide, high


def _transform_of(element: Element) -> NDArray[np.float64]:
    """Return the transform of an element into the one around it, (3, 3)."""
    found = Matrix(element.get("transform", ""))
    return np.array([[found.a, found.c, found.e], [found.b, found.d, found.f], [0.0, 0.0, 1.0]], np.float64)


_UPWARDS = ("y", "y1", "y2", "cy", "ry", "height")


def outlines(element: Element, kind: str, view: _View = (math.nan, math.nan)) -> list[Polyline]:
    """Return the outlines of a shape; none if it is no shape."""

    def value(name: str) -> float:
        whole = math.hypot(*view) / math.sqrt(2.0) if name == "r" else view[name in _UPWARDS]
        return _length(element.get(name), whole=whole)

    if kind == "line":
        return [np.array([[value("x1"), value("y1")], [value("x2"), value("y2")]])]
    if kind == "rect":
        x, y, width, height = (value(name) for name in ("x", "y", "width", "height"))
        corners = [(x, y), (x + width, y), (x + width, y + height), (x, y + height), (x, y)]
        return [] if width <= 0.0 or height <= 0.0 else [np.array(corners)]
    if kind in ("circle", "ellipse"):
        wide, high = (value("r"),) * 2 if kind == "circle" else (value("rx"), value("ry"))
        turns = np.linspace(0.0, 2.0 * math.pi, 4 * CURVE_PARTS + 1)
        ring = np.stack([value("cx") + wide * np.cos(turns), value("cy") + high * np.sin(turns)], axis=1)
        ring[-1] = ring[0]
        return [] if wide <= 0.0 or high <= 0.0 else [ring]
    if kind in ("polyline", "polygon"):
        given = _numbers(element.get("points", ""))
        points = np.array(given[: len(given) // 2 * 2]).reshape(-1, 2)
        if kind == "polygon" and len(points) > 2:
            points = np.concatenate([points, points[:1]])
        return [points] if len(points) > 1 else []
    return list(_path(element.get("d", ""))) if kind == "path" else []


def _commands(text: str) -> Iterator[tuple[str, list[float]]]:
    """Yield each command of a path with the numbers that it wants."""
    for command, words in _COMMANDS.findall(text):
        wants = _WANTS.get(command, 0)
        if command in "Aa":
            given = [float(word) for arc in _ARCS.findall(words) for word in arc]
        else:
            given = _numbers(words)
        if not wants:
            yield command, []
            continue
        if not given or len(given) % wants:
            raise ValueError(f"a path has {command!r} with {len(given)} numbers; want {wants}, or more of them")
        yield command, given[:wants]
        for place in range(wants, len(given), wants):
            # Coordinates after a first point without a command of their own are lines.
            yield {"M": "L", "m": "l"}.get(command, command), given[place : place + wants]


def _path(text: str) -> Iterator[Polyline]:
    """Yield the parts of a path."""
    here = start = 0j
    control: complex | None = None
    points: list[complex] = []
    for command, given in _commands(text):
        if command in "Zz":
            if points:
                yield _points([*points, start])
            here, points, control = start, [], None
            continue
        if command in "Mm":
            if len(points) > 1:
                yield _points(points)
            here = complex(*given) + (here if command == "m" else 0j)
            start, points, control = here, [here], None
            continue
        if len(points) > MAX_POINTS:
            raise ValueError(f"a path has more than {MAX_POINTS:,} points; want a plan, or a picture of it")
        if not points:
            points = [here]
        if command in "Ll":  # most are
            points.append(complex(*given) + (here if command == "l" else 0j))
            control = None
        else:
            added, control = _part(command, given, here, control)
            points += added
        here = points[-1]
    if len(points) > 1:
        yield _points(points)


def _points(points: list[complex]) -> Polyline:
    return np.array(points, np.complex128).view(np.float64).reshape(-1, 2)


def _part(
    command: str, given: list[float], here: complex, control: complex | None
) -> tuple[list[complex], complex | None]:
    """Return the points that a command adds, and the control point that a smooth curve mirrors."""
    kind, base = command.upper(), here if command.islower() else 0j
    if kind == "H":
        return [complex(given[0] + base.real, here.imag)], None
    if kind == "V":
        return [complex(here.real, given[0] + base.imag)], None
    if kind == "A":
        return _arc(here, given, complex(given[5], given[6]) + base), None
    ends = [complex(*given[k : k + 2]) + base for k in range(0, len(given), 2)]
    if kind in "ST":
        ends = [here if control is None else 2.0 * here - control, *ends]
    curve = CubicBezier(here, *ends) if kind in "CS" else QuadraticBezier(here, *ends)
    return _along(curve, _SHARES), ends[-2]


def _arc(here: complex, given: list[float], end: complex) -> list[complex]:
    """Return points of an elliptic arc after its first, from its ends."""
    if given[0] == 0.0 or given[1] == 0.0 or here == end:
        return [end]
    arc = Arc(here, *given[:5], end)
    parts = max(math.ceil(abs(arc.sweep) / (0.5 * math.pi) * CURVE_PARTS), 1)
    return [*_along(arc, np.arange(1, parts) / parts), end]


def _along(curve: PathSegment, shares: NDArray[np.float64]) -> list[complex]:
    points: list[complex] = (curve.npoint(shares) @ (1.0, 1.0j)).tolist()
    return points


RESOLUTION = 0.025
MIN_WIDTH = 0.05
"""Minimum width of a line [m]."""

_MARGIN = 0.5
_FREE_ABOVE = 127 / 255
_DEEPEST = 64
_MAX_ELEMENTS = 250_000
"""Most elements that are drawn, each as often as it is used."""

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
_PARTS = frozenset(("svg", "symbol"))
"""Elements that may have a view box."""

_OF_STYLE = (
    "fill",
    "stroke",
    "stroke-width",
    "display",
    "visibility",
    "color",
    "opacity",
    "fill-opacity",
    "stroke-opacity",
    "fill-rule",
    "stroke-linecap",
)
_UNREAD = ("clip-path", "mask", "stroke-dasharray", "systemLanguage", "transform-origin")
"""Attributes and properties that are not understood."""

_NAMED = frozenset(("class", "style", *_OF_STYLE, *_UNREAD))
"""Attributes without any of which an element looks as those around it."""

_DEFAULTS = {
    "fill": "black",
    "stroke": "none",
    "stroke-width": "1",
    "display": "inline",
    "visibility": "visible",
    "color": "black",
    "opacity": "1",
    "fill-opacity": "1",
    "stroke-opacity": "1",
    "fill-rule": "nonzero",
    "stroke-linecap": "butt",
}

Style = dict[str, str]


_Layer = tuple[int, NDArray[np.float64] | None, bool, NDArray[np.float64], NDArray[np.float64], float]
"""Paint: 1 for solid, 0 for free; edges of an inside, and whether its rings add up; lines (N, 4), how far each goes
beyond its ends, (N, 2), as a share of their width, and that [m]."""

_VALUE: Callable[[_Layer], int] = operator.itemgetter(0)

_NO_LINES = np.zeros((0, 4)), np.zeros((0, 2)), 0.0


@dataclass(frozen=True, slots=True, eq=False)
class _Shape:
    """A shape of a drawing in metres, y up; None is not painted."""

    outlines: list[Polyline]
    is_solid_inside: bool | None
    is_solid_line: bool | None
    width: float
    is_nonzero: bool
    has_caps: bool


def has_scale(path: Path) -> bool:
    """Return False: a drawing does not state its scale."""
    return False


def load(path: Path, resolution: float | None) -> Floor:
    """Read a drawing of which a unit is ``resolution`` long [m], in cells of 0.025 m."""
    if resolution is None:
        raise ValueError(
            f"{path} does not say how large it is; want image_resolution (--resolution), the metres of a unit"
        )
    try:
        root = ElementTree.fromstring(read_text(path))
    except ElementTree.ParseError as error:
        raise ValueError(f"{path} is not XML: {error}") from error
    if _kind(root) != "svg":
        raise ValueError(f"{path} begins with {shown(_kind(root))}; want an svg element")
    to_metres = np.diag([resolution, -resolution, 1.0])
    drawing = _Drawing(root)
    found = drawing.shapes(root, to_metres, dict(_DEFAULTS), (), (math.nan, math.nan))
    shapes = list(few_enough(path, found, lambda shape: sum(map(len, shape.outlines))))
    drawn = [shape for shape in shapes if shape.is_solid_line or shape.is_solid_inside]
    if not drawn:
        raise ValueError(f"{path} has no dark lines or areas; want a plan whose walls are dark")
    rings = [outline for shape in drawn for outline in shape.outlines]
    points = np.concatenate(rings)
    low, high = points.min(axis=0) - _MARGIN, points.max(axis=0) + _MARGIN
    check_extent(str(path), (*low.tolist(), *high.tolist()), rings)
    columns, rows = (int(size) + 1 for size in (high - low) / RESOLUTION)
    if rows * columns > MAX_PIXELS:
        raise ValueError(
            f"{path} has {columns} x {rows} cells at {RESOLUTION} m, more than {MAX_PIXELS:,}; give "
            "a smaller image_resolution (--resolution)"
        )
    solid, origin = np.zeros((rows, columns), np.uint8), (float(low[0]), float(low[1]))
    # One over the other, in the order of painting; those of one colour at once.
    for value, layers in itertools.groupby(itertools.chain.from_iterable(map(_layers, shapes)), _VALUE):
        _, insides, rules, lines, shares, widths = zip(*layers, strict=True)
        for rule in (False, True):
            filled = [each for each, own in zip(insides, rules, strict=True) if each is not None and own == rule]
            fill_shapes(solid, origin, RESOLUTION, filled, value, is_nonzero=rule)
        of_segments = np.repeat(widths, [len(each) for each in lines])
        strips = strip_edges(np.concatenate(lines), of_segments, np.concatenate(shares))
        fill_shapes(solid, origin, RESOLUTION, strips, value)
    floor = floor_of_cells(path, solid == 0, origin, RESOLUTION)
    remarks = [each for each in (floor.remark, *drawing.remarks()) if each]
    return replace(floor, remark="; ".join(remarks))


def _layers(shape: _Shape) -> Iterator[_Layer]:
    """Yield the painted parts of a shape: its inside first, then its line."""
    if shape.is_solid_inside is not None:
        rings = [ring_edges(outline) for outline in shape.outlines if len(outline) > 2]
        if rings:
            yield int(shape.is_solid_inside), np.concatenate(rings), shape.is_nonzero, *_NO_LINES
    if shape.is_solid_line is not None:
        width = max(shape.width, MIN_WIDTH) if shape.is_solid_line else shape.width
        segments = np.concatenate([np.hstack([line[:-1], line[1:]]) for line in shape.outlines])
        shares = np.concatenate([_beyond_ends(line, shape, width) for line in shape.outlines])
        yield int(shape.is_solid_line), None, False, segments, shares, width


def _beyond_ends(line: Polyline, shape: _Shape, width: float) -> NDArray[np.float64]:
    """Return how far each segment of a line goes beyond its ends, (N, 2), as a share of the width.

    That is to its corners, and at free ends as far as the line has caps, or is drawn wider than it is.
    """
    shares = np.full((len(line) - 1, 2), 0.5)
    if not (shape.has_caps or (line[0] == line[-1]).all()):
        shares[0, 0] = shares[-1, 1] = 0.5 * (width - min(shape.width, width)) / width if width > 0.0 else 0.0
    return shares


class _Drawing:
    """The elements of a drawing, with their styles.

    Parameters
    ----------
    root : Element
        The svg element.
    """

    def __init__(self, root: Element) -> None:
        self._named = {name: each for each in root.iter() if (name := each.get("id"))}
        self._sheet = StyleSheet("".join("".join(each.itertext()) for each in root.iter() if _kind(each) == "style"))
        self._pictures = self._drawn = 0
        self._unread: Counter[str] = Counter()
        self._painted: tuple[Style | None, tuple[bool | None, bool | None]] = None, (None, None)

    def remarks(self) -> Iterator[str]:
        """Yield the parts of the drawing that are left out."""
        if self._pictures:
            yield f"{self._pictures} pictures in the drawing are left out"
        for name, count in sorted(self._unread.items()):
            yield f"elements drawn without their {name}, which is not understood: {count}"
        if self._sheet.unread:
            yield f"{self._sheet.unread} rules of its style sheet are not understood and left out"

    def shapes(
        self,
        element: Element,
        around: NDArray[np.float64],
        inherited: Style,
        path: tuple[Element, ...],
        view: _View,
    ) -> Iterator[_Shape]:
        """Yield the shapes of an element and of all within it, in the order in which they are painted.

        ``path`` holds the elements around it, the outermost first; lengths may be shares of ``view``.
        """
        kind = _kind(element)
        if kind in _UNSEEN and not (kind == "symbol" and path and _kind(path[-1]) == "use"):
            return
        self._drawn += 1
        if len(path) > _DEEPEST:
            raise ValueError(f"elements are nested more than {_DEEPEST} deep; want a plan")
        if self._drawn > _MAX_ELEMENTS:
            raise ValueError(f"it draws more than {_MAX_ELEMENTS:,} elements; want a plan, or a picture of it")
        path = (*path, element)
        style = self._style(path, inherited)
        if style["display"].strip() == "none":
            return
        matrix = around @ _transform_of(element) if "transform" in element.attrib else around
        if kind == "svg" and len(path) > 1:
            matrix = matrix @ _placed(element, element, view)
        if kind in _PARTS:
            view = _view_within(element, view)
        found = outlines(element, kind, view)
        if found and style["visibility"].strip() == "visible":
            placed = [outline @ matrix[:2, :2].T + matrix[:2, 2] for outline in found]
            (a, b), (c, d) = matrix[:2, :2].tolist()
            scale = math.sqrt(abs(a * d - b * c))
            width = _length(style["stroke-width"], 1.0, math.hypot(*view) / math.sqrt(2.0)) * scale
            inside, line = self._paints(style)
            shape = _Shape(
                placed,
                None if kind == "line" else inside,
                line,
                width,
                style["fill-rule"].strip() != "evenodd",
                style["stroke-linecap"].strip() != "butt",
            )
            if math.isfinite(width + sum(outline.sum() for outline in placed)):
                yield shape
            elif shape.is_solid_inside or shape.is_solid_line:
                raise ValueError("a length is a share of the drawing, which has no viewBox; want a viewBox")
        self._pictures += kind == "image"
        if kind == "use" and (used := self._named.get(_link(element))) is not None:
            shifted = matrix @ _placed(element, used, view)
            yield from self.shapes(used, shifted, style, path, view)
        for child in element:
            yield from self.shapes(child, matrix, style, path, view)

    def _style(self, path: tuple[Element, ...], inherited: Style) -> Style:
        """Return the style of an element.

        Its own style takes precedence over the style sheet, this over its attributes, these over inherited ones.
        Opacity is not inherited: that of a group is of all in it.
        """
        element = path[-1]
        if self._sheet.is_empty and _NAMED.isdisjoint(element.attrib):
            return inherited
        given = settled(self._sheet.declared(path) | declared(element.get("style", "")))
        self._unread.update(name for name in _UNREAD if (given.get(name) or element.get(name, "none")) != "none")
        self._unread.update({"transform in a style": 1} if given.get("transform", "none") != "none" else {})
        own = {name: value for name in _OF_STYLE if (value := element.get(name)) is not None}
        own |= {name: value for name, value in given.items() if name in _OF_STYLE}
        opacity = share_of(own.pop("opacity", "1"), 1.0) * float(inherited["opacity"])
        own = {name: inherited[name] if value.strip() == "inherit" else value for name, value in own.items()}
        return {**inherited, **own, "opacity": str(opacity)}

    def _paints(self, style: Style) -> tuple[bool | None, bool | None]:
        """Return whether the inside and the line of shapes are dark; most shapes share the style of the last one."""
        if self._painted[0] is not style:
            self._painted = style, (self._is_dark(style, "fill"), self._is_dark(style, "stroke"))
        return self._painted[1]

    def _is_dark(self, style: Style, what: str) -> bool | None:
        """Return whether a paint makes dark what it covers, whatever was there; None if that depends on it.

        What is painted thinly is seen through: it counts as what is seen on white if that is dark, and as light if
        even on black it is.
        """
        opacity = float(style["opacity"]) * share_of(style[f"{what}-opacity"], 1.0)
        colour = style[what].strip()
        if colour.lower() == "currentcolor":
            colour = style["color"]
        if found := re.match(r"url\(\s*['\"]?#([^)'\"]*)['\"]?\s*\)\s*(.*)", colour):
            server = self._named.get(found[1])
            lights = [] if server is None else self._stops(server, 0)
            if not lights and server is not None and _kind(server) == "pattern":
                lights = [(0.0, 1.0)]  # hatched, as walls are
            if not lights:
                lights = [light_of(found[2] or "none")]
            light, own = (sum(values) / len(values) for values in zip(*lights, strict=True))
        else:
            light, own = light_of(colour)
        opacity *= own
        if opacity * light + 1.0 - opacity <= _FREE_ABOVE:
            return True
        return False if opacity * light > _FREE_ABOVE else None

    def _stops(self, gradient: Element, depth: int) -> list[tuple[float, float]]:
        """Return lightness and opacity of the stops of a gradient; those of another one that it refers to."""
        found = []
        for stop in gradient:
            if _kind(stop) == "stop":
                given = settled({**stop.attrib, **self._sheet.declared((stop,)), **declared(stop.get("style", ""))})
                light, opacity = light_of(given.get("stop-color", "black"))
                found.append((light, opacity * share_of(given.get("stop-opacity", "1"), 1.0)))
        other = self._named.get(_link(gradient))
        if found or other is None or depth > _DEEPEST:
            return found
        return self._stops(other, depth + 1)


def _kind(element: Element) -> str:
    """Return the name of an element without its name space."""
    return str(element.tag).rpartition("}")[2]


def _link(element: Element) -> str:
    """Return the name of the element that one refers to."""
    link = element.get("href") or element.get("{http://www.w3.org/1999/xlink}href") or ""
    return link.strip().removeprefix("#")


def _placed(use: Element, used: Element, view: _View) -> NDArray[np.float64]:
    """Return where an element is used, (3, 3): a symbol with a view box fits into the size asked for.

    A drawing within a drawing is placed as one that is used where it stands.
    """
    x, y = (_length(use.get(name), whole=whole) for name, whole in zip("xy", view, strict=True))
    box = _numbers(used.get("viewBox", ""))
    matrix = np.array([[1.0, 0.0, x], [0.0, 1.0, y], [0.0, 0.0, 1.0]])
    if not (_kind(used) == "symbol" or use is used) or len(box) != 4 or not (box[2] > 0.0 and box[3] > 0.0):
        return matrix
    wide, high = (
        _length(use.get(name) or used.get(name), whole if math.isfinite(whole) else size, whole)
        for name, size, whole in zip(("width", "height"), box[2:], view, strict=True)
    )
    # SVG 2, section 8.6: by default the middle of the view box is in the middle of the size.
    align, *how = used.get("preserveAspectRatio", "xMidYMid").split() or ["xMidYMid"]
    scales = np.array([wide / box[2], high / box[3]])
    if align != "none":
        scales[:] = scales.max() if how == ["slice"] else scales.min()
    shares = [{"Min": 0.0, "Max": 1.0}.get(align[k : k + 3], 0.5) for k in (1, 5)]
    shift_x, shift_y = (
        share * (size - scale * length) - scale * low
        for share, size, scale, length, low in zip(shares, (wide, high), scales, box[2:], box[:2], strict=True)
    )
    inner = np.array([[scales[0], 0.0, shift_x], [0.0, scales[1], shift_y], [0.0, 0.0, 1.0]])
    return np.asarray(matrix @ inner, np.float64)
