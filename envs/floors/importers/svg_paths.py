"""Outlines of the shapes of SVG drawings, as polylines.

``svgelements`` computes transforms, curves and arcs. Commands are split here: its parser makes an object of
each line, which takes four times as long, and leaves out what it does not understand.
"""

import math
import re
from collections.abc import Iterator
from xml.etree.ElementTree import Element

import numpy as np
from numpy.typing import NDArray
from svgelements import Arc, CubicBezier, Matrix, PathSegment, QuadraticBezier

from lidarium.envs.floors.importers.common import MOST_POINTS

Polyline = NDArray[np.float64]
"""Points x, y (n, 2) in the drawing's units; closed where the last is the first."""

CURVE_PARTS = 16
"""Straight parts of a curve, and of a quarter of a circle."""

_SHARES = np.arange(1, CURVE_PARTS + 1) / CURVE_PARTS

_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_NUMBERS = re.compile(_NUMBER)
_COMMANDS = re.compile(r"([MmZzLlHhVvCcSsQqTtAa])([^MmZzLlHhVvCcSsQqTtAa]*)")
# Flags are single digits that may stand together with what follows.
_ARCS = re.compile(
    rf"({_NUMBER})[\s,]*({_NUMBER})[\s,]*({_NUMBER})[\s,]*([01])[\s,]*([01])[\s,]*({_NUMBER})[\s,]*({_NUMBER})"
)
_WANTS = {"M": 2, "L": 2, "H": 1, "V": 1, "C": 6, "S": 4, "Q": 4, "T": 2, "A": 7}
_WANTS |= {command.lower(): count for command, count in _WANTS.items()}


def numbers(text: str) -> list[float]:
    """Return the numbers of a text."""
    return list(map(float, _NUMBERS.findall(text)))


def length(text: str | None, otherwise: float = 0.0) -> float:
    """Return a length in the drawing's units; what is given in others is taken for these."""
    found = numbers(text or "")
    return found[0] if found else otherwise


def transform_of(element: Element) -> NDArray[np.float64]:
    """Return the transform of an element into the one around it, (3, 3)."""
    found = Matrix(element.get("transform", ""))
    return np.array([[found.a, found.c, found.e], [found.b, found.d, found.f], [0.0, 0.0, 1.0]], np.float64)


def outlines(element: Element, kind: str) -> list[Polyline]:
    """Return the outlines of a shape; none where it is no shape."""

    def value(name: str) -> float:
        return length(element.get(name))

    if kind == "line":
        return [np.array([[value("x1"), value("y1")], [value("x2"), value("y2")]])]
    if kind == "rect":
        x, y, width, height = (value(name) for name in ("x", "y", "width", "height"))
        corners = [(x, y), (x + width, y), (x + width, y + height), (x, y + height), (x, y)]
        return [np.array(corners)] if width > 0.0 and height > 0.0 else []
    if kind in ("circle", "ellipse"):
        wide, high = (value("r"),) * 2 if kind == "circle" else (value("rx"), value("ry"))
        turns = np.linspace(0.0, 2.0 * math.pi, 4 * CURVE_PARTS + 1)
        ring = np.stack([value("cx") + wide * np.cos(turns), value("cy") + high * np.sin(turns)], axis=1)
        ring[-1] = ring[0]
        return [ring] if wide > 0.0 and high > 0.0 else []
    if kind in ("polyline", "polygon"):
        given = numbers(element.get("points", ""))
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
            given = numbers(words)
        if not wants:
            yield command, []
            continue
        if not given or len(given) % wants:
            raise ValueError(
                f"a path has {command!r} with {len(given)} numbers; want {wants}, or more of them"
            )
        yield command, given[:wants]
        for place in range(wants, len(given), wants):
            # What follows a first point without a command of its own are lines.
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
        if len(points) > MOST_POINTS:
            raise ValueError(f"a path has more than {MOST_POINTS:,} points; want a plan, or a picture of it")
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
