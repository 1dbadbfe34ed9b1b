"""What of a drawing's text needs no parser: straight walls, which are most of it, and what is no wall.

A drawing is pairs of lines, a group code and a value; code 0 begins an entity. Entities of the section
ENTITIES whose codes are all plain are read here, in a third of the time of a parser.

References
----------
Autodesk, DXF Reference: Group Codes in Numerical Order; ENTITIES Section.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

KINDS = frozenset(("LINE", "LWPOLYLINE", "POLYLINE", "ARC", "CIRCLE", "ELLIPSE", "SPLINE"))
"""Entities that are walls; texts, dimensions, hatches and the like are none."""

COMPOUND = frozenset(("INSERT", "MLINE"))
"""Entities that are made of others."""

_KEPT = KINDS | COMPOUND | {"VERTEX", "ATTRIB", "SEQEND"}
"""What stays in the text, with the parts of what is made of several."""

# Handles, owner, marks of classes, layer, colours, line types and weights: they move nothing.
_LOOKS = frozenset(("5", "330", "100", "8", "6", "62", "370", "420", "48"))
_PLAIN = {
    "LINE": _LOOKS | {"10", "20", "30", "11", "21", "31"},
    "LWPOLYLINE": _LOOKS | {"90", "70", "43", "38", "10", "20"},
    "POLYLINE": _LOOKS | {"66", "70", "10", "20", "30", "40", "41"},
    "VERTEX": _LOOKS | {"70", "10", "20", "30"},
}
"""Codes of entities that are read here; with others, as a bulge or another plane, they are left."""

_ENTITY = re.compile(r"^[ \t]*0[ \t]*\n[ \t]*[A-Z]", re.MULTILINE)

Polyline = NDArray[np.float64]
"""Points x, y (n, 2) in the drawing's units; closed where the last is the first."""


@dataclass(slots=True)
class Sifted:
    """A drawing in two parts.

    Attributes
    ----------
    text : str
        What is left for a parser.
    walls : list of (layer, (n, 2) float64)
        Straight walls, with the layers that they are on.
    """

    text: str
    walls: list[tuple[str, Polyline]] = field(default_factory=list)

    @property
    def entities(self) -> int:
        """How many entities are left, tables and blocks among them."""
        return sum(1 for _ in _ENTITY.finditer(self.text))


@dataclass(slots=True)
class _Entity:
    """An entity: its kind, its codes and values, and at which pair it begins."""

    kind: str
    codes: list[str]
    values: list[str]
    begin: int

    def numbers(self, code: str) -> list[float]:
        return [float(value) for each, value in zip(self.codes, self.values, strict=True) if each == code]

    def value(self, code: str, otherwise: str) -> str:
        """Return the value of a code that stands once at most."""
        return self.values[self.codes.index(code)].strip() if code in self.codes else otherwise

    @property
    def is_plain(self) -> bool:
        return _PLAIN[self.kind].issuperset(self.codes)


def sift(text: str) -> Sifted:
    """Take straight walls out of a drawing's text, and leave out what is no wall.

    What is not as it should be stays, for a parser to repair or to refuse.
    """
    rows = text.split("\n")
    codes, values = [code.strip() for code in rows[0::2]], rows[1::2]
    codes = codes[: len(values)]
    found, is_left = Sifted(text), np.ones(len(codes), np.bool_)
    entities = list(_entities(codes, values))
    ends = [entity.begin for entity in entities[1:]] + [entities[-1].begin] if entities else []
    place = 0
    while place < len(entities) - 1:  # the last one ends the section
        count, wall = _wall(entities, place)
        if wall is not None:
            found.walls.append((entities[place].value("8", "0"), wall))
        if wall is not None or entities[place].kind not in _KEPT:
            is_left[entities[place].begin : ends[place + count - 1]] = False
        place += count
    if not is_left.all():
        kept = [f"{rows[2 * k]}\n{rows[2 * k + 1]}" for k in np.flatnonzero(is_left)]
        found.text = "\n".join([*kept, *rows[2 * len(codes) :]])
    return found


def _entities(codes: list[str], values: list[str]) -> Iterator[_Entity]:
    """Yield the entities of the section ENTITIES, and what ends it."""
    starts = [k for k, code in enumerate(codes) if code == "0"]
    is_inside = False
    for begin, end in zip(starts, [*starts, len(codes)][1:], strict=True):
        kind = values[begin].strip()
        if is_inside:
            yield _Entity(kind, codes[begin + 1 : end], values[begin + 1 : end], begin)
        if is_inside and kind in ("ENDSEC", "EOF"):
            return
        if kind == "SECTION":
            is_inside = codes[begin + 1 : begin + 2] == ["2"] and values[begin + 1].strip() == "ENTITIES"


def _wall(entities: list[_Entity], place: int) -> tuple[int, Polyline | None]:
    """Return of how many entities one is made, and the wall that it is if it can be read here."""
    entity, count = entities[place], 1
    if entity.kind == "POLYLINE":
        while place + count < len(entities) and entities[place + count].kind in ("VERTEX", "SEQEND"):
            count += 1
            if entities[place + count - 1].kind == "SEQEND":
                break
    if entity.kind not in ("LINE", "LWPOLYLINE", "POLYLINE") or not entity.is_plain:
        return count, None
    try:
        return count, _READERS[entity.kind](entity, entities[place + 1 : place + count])
    except (ValueError, OverflowError):
        return count, None


def _line(entity: _Entity, parts: list[_Entity]) -> Polyline:
    (x1,), (y1,), (x2,), (y2,) = (entity.numbers(code) for code in ("10", "20", "11", "21"))
    return np.array([(x1, y1), (x2, y2)])


def _light_polyline(entity: _Entity, parts: list[_Entity]) -> Polyline | None:
    return _polyline(entity.numbers("10"), entity.numbers("20"), entity.value("70", "0"), (0, 1, 128, 129))


def _heavy_polyline(entity: _Entity, parts: list[_Entity]) -> Polyline | None:
    vertices = [part for part in parts if part.kind == "VERTEX"]
    is_whole = len(parts) == len(vertices) + 1
    if not is_whole or not all(part.is_plain and part.value("70", "0") == "0" for part in vertices):
        return None
    x, y = ([number for part in vertices for number in part.numbers(code)] for code in ("10", "20"))
    return _polyline(x, y, entity.value("70", "0"), (0, 1)) if len(x) == len(vertices) else None


def _polyline(x: list[float], y: list[float], flags: str, plain: tuple[int, ...]) -> Polyline | None:
    """Return a polyline; None where it has other flags than for closed, or numbers without a partner."""
    if len(x) != len(y) or len(x) < 2 or int(flags) not in plain:
        return None
    points = np.array([x, y]).T
    return np.concatenate([points, points[:1]]) if int(flags) & 1 else points


_READERS = {"LINE": _line, "LWPOLYLINE": _light_polyline, "POLYLINE": _heavy_polyline}
