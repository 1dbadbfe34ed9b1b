"""Outlines of the shapes of SVG drawings, as polylines.

References
----------
W3C, Scalable Vector Graphics (SVG) 2, chapters 8 to 10 and appendix B.2 (arcs).
"""

import math
import re
from collections.abc import Iterator
from xml.etree.ElementTree import Element

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.floors.importers.common import MOST_POINTS

Polyline = NDArray[np.float64]
"""Points x, y (n, 2) in the drawing's units; closed where the last is the first."""

CURVE_PARTS = 16
"""Straight parts of a curve, and of a quarter of a circle."""

_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_NUMBERS = re.compile(_NUMBER)
_COMMANDS = re.compile(r"([MmZzLlHhVvCcSsQqTtAa])([^MmZzLlHhVvCcSsQqTtAa]*)")
# Flags are single digits that may stand together with what follows.
_ARCS = re.compile(
    rf"({_NUMBER})[\s,]*({_NUMBER})[\s,]*({_NUMBER})[\s,]*([01])[\s,]*([01])[\s,]*({_NUMBER})[\s,]*({_NUMBER})"
)
_TRANSFORM = re.compile(r"(matrix|translate|scale|rotate|skewX|skewY)\s*\(([^)]*)\)")
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
    """Return how an element lies in the one around it, (3, 3)."""
    whole = np.eye(3)
    for kind, text in _TRANSFORM.findall(element.get("transform", "")):
        whole = whole @ _matrix(kind, numbers(text))
    return whole


def _matrix(kind: str, given: list[float]) -> NDArray[np.float64]:
    values = [*given, *[0.0] * 6]
    if kind == "matrix":
        a, b, c, d, e, f = values[:6]
    elif kind == "translate":
        a, b, c, d, e, f = 1.0, 0.0, 0.0, 1.0, values[0], values[1]
    elif kind == "scale":
        a, b, c, d, e, f = values[0], 0.0, 0.0, values[1] if len(given) > 1 else values[0], 0.0, 0.0
    elif kind == "rotate":
        angle = math.radians(values[0])
        a, b, c, d = math.cos(angle), math.sin(angle), -math.sin(angle), math.cos(angle)
        x, y = values[1], values[2]
        e, f = x - a * x - c * y, y - b * x - d * y
    else:
        slope = math.tan(math.radians(values[0]))
        a, d, e, f = 1.0, 1.0, 0.0, 0.0
        b, c = (0.0, slope) if kind == "skewX" else (slope, 0.0)
    return np.array([[a, c, e], [b, d, f], [0.0, 0.0, 1.0]])


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
    return _bezier([here, *ends]), ends[-2]


def _bezier(controls: list[complex]) -> list[complex]:
    """Return points of a Bezier curve behind its first, by Bernstein's polynomials."""
    degree = len(controls) - 1
    shares = np.arange(1, CURVE_PARTS + 1) / CURVE_PARTS
    curve = sum(
        math.comb(degree, k) * shares**k * (1.0 - shares) ** (degree - k) * control
        for k, control in enumerate(controls)
    )
    return list(np.asarray(curve).tolist())


def _arc(here: complex, given: list[float], end: complex) -> list[complex]:
    """Return points of an elliptic arc behind its first, from its ends."""
    wide, high, turn = abs(given[0]), abs(given[1]), np.exp(1j * math.radians(given[2]))
    if wide == 0.0 or high == 0.0 or here == end:
        return [end]
    middle = (here - end) / 2.0 / turn
    x, y = middle.real / wide, middle.imag / high
    grown = max(math.hypot(x, y), 1.0)
    wide, high, x, y = wide * grown, high * grown, x / grown, y / grown
    # On the circle to which the ellipse is shrunk: from its centre to the middle of the chord.
    root = math.sqrt(max(1.0 / (x * x + y * y) - 1.0, 0.0))
    sign = -1.0 if bool(given[3]) == bool(given[4]) else 1.0
    centre = complex(sign * root * y, -sign * root * x)
    first, last = np.angle(complex(x, y) - centre), np.angle(complex(-x, -y) - centre)
    swept = (last - first) % (2.0 * math.pi)
    if not given[4]:
        swept -= 2.0 * math.pi
    parts = max(math.ceil(abs(swept) / (0.5 * math.pi) * CURVE_PARTS), 1)
    unit = np.exp(1j * (first + swept * np.arange(1, parts + 1) / parts)) + centre
    curve = (here + end) / 2.0 + turn * (wide * unit.real + 1j * high * unit.imag)
    return [*curve[:-1].tolist(), end]
