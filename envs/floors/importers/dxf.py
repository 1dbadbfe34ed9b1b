"""Reads DXF drawings as floors: lines, polylines and curves are walls.

Inserted blocks are taken apart. The drawing's unit gives its scale.

References
----------
Autodesk, DXF Reference: Group Codes in Numerical Order; ENTITIES Section.
"""

import codecs
import io
import logging
import re
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.floors.floor import MAX_COORDINATE_M, Floor
from lidarium.envs.floors.importers.common import MAX_POINTS, MAX_TEXT_BYTES, floor_of_lines
from lidarium.extras import install_command
from lidarium.mapping.files.guarded_reading import READING_ERRORS, read_bytes, shortened

KINDS = frozenset(("LINE", "LWPOLYLINE", "POLYLINE", "ARC", "CIRCLE", "ELLIPSE", "SPLINE"))
"""Entities that are walls; texts, dimensions, hatches and the like are not."""

COMPOUND = frozenset(("INSERT", "MLINE"))
"""Entities that are made of others."""

_KEPT = KINDS | COMPOUND | {"VERTEX", "ATTRIB", "SEQEND"}
"""Entities that stay in the text, with the parts of compound ones."""

# Handles, owner, marks of classes, layer, colours, line types and weights: they move nothing.
_LOOKS = frozenset(("5", "330", "100", "8", "6", "62", "370", "420", "48"))
_PLAIN = {
    "LINE": _LOOKS | {"10", "20", "30", "11", "21", "31"},
    "LWPOLYLINE": _LOOKS | {"90", "70", "43", "38", "10", "20"},
    "POLYLINE": _LOOKS | {"66", "70", "10", "20", "30", "40", "41"},
    "VERTEX": _LOOKS | {"70", "10", "20", "30"},
}
"""Codes of entities that are read here; with others, as a bulge or another plane, they are left."""

_VERSION = re.compile(rb"\$ACADVER\s+1\s+AC(\d{4})")
_CODE_PAGE = re.compile(rb"\$DWGCODEPAGE\s+3\s+ANSI_(\d+)", re.IGNORECASE)
_ENTITY = re.compile(r"^[ \t]*0[ \t]*\n[ \t]*[A-Z]", re.MULTILINE)

Polyline = NDArray[np.float64]
"""Points x, y (n, 2) in the drawing's units; closed if the last is the first."""


@dataclass(slots=True)
class _Sifted:
    """A drawing in two parts.

    Attributes
    ----------
    text : str
        The rest, for a parser.
    walls : list of (layer, (n, 2) float64)
        Straight walls, with the layers that they are on.
    """

    text: str
    walls: list[tuple[str, Polyline]] = field(default_factory=list)

    @property
    def entities(self) -> int:
        """Number of entities are left, tables and blocks among them."""
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
        """Return the value of a code that occurs at most once."""
        return self.values[self.codes.index(code)].strip() if code in self.codes else otherwise

    @property
    def is_plain(self) -> bool:
        return _PLAIN[self.kind].issuperset(self.codes)


def _sift(text: str) -> _Sifted:
    """Take straight walls out of a drawing's text, and leave out the other entities.

    Malformed entities stay, for a parser to repair or to refuse.
    """
    rows = text.split("\n")
    codes, values = [code.strip() for code in rows[0::2]], rows[1::2]
    codes = codes[: len(values)]
    found, is_left = _Sifted(text), np.ones(len(codes), np.bool_)
    entities = list(_sifted_entities(codes, values))
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


def _sifted_entities(codes: list[str], values: list[str]) -> Iterator[_Entity]:
    """Yield the entities of the section ENTITIES, and its end."""
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
    """Return the number of entities that form one, and the wall that it is if it can be read here."""
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
    """Return a polyline; None if it has other flags than for closed, or numbers without a partner."""
    if len(x) != len(y) or len(x) < 2 or int(flags) not in plain:
        return None
    points = np.array([x, y]).T
    return np.concatenate([points, points[:1]]) if int(flags) & 1 else points


_READERS = {"LINE": _line, "LWPOLYLINE": _light_polyline, "POLYLINE": _heavy_polyline}


logging.getLogger("ezdxf").addHandler(logging.NullHandler())  # otherwise it writes each repair to the console

CURVE_ERROR_M = 0.01
"""Maximum deviation of the straight parts from a curve [m]."""

CURVE_SHARE = 1e-4
"""Minimum of that deviation, as a share of the size of the curve."""

_METRES = {1: 0.0254, 2: 0.3048, 4: 0.001, 5: 0.01, 6: 1.0, 10: 0.9144, 14: 0.1}
"""Metres of a unit by the number that $INSUNITS has for it."""

_UNIT = re.compile(rb"\$INSUNITS\s+70\s+(\d{1,3})\s")

_MIN_ALLOWED, _BYTES = {"wall": 25_000, "parsed": 4_000}, {"wall": 40, "parsed": 200}
"""Number of straight walls and parsed entities any drawing may have, and of how many bytes one more.

Those of CAD programs take more bytes; files with more of them take long, and are not plans.
"""

_DEEPEST = 16

_MIN_SIDE_M, _MAX_SIDE_M = 2.0, 200.0
"""Sides of drawings whose unit is not remarked on [m]."""

_MAX_NAMED = 200
"""Most letters of names of layers in a message."""


def has_scale(path: Path) -> bool:
    """Return whether the drawing has a unit; the rest of it is not parsed for that."""
    found = _UNIT.search(read_bytes(path, MAX_TEXT_BYTES))
    return found is not None and int(found[1]) in _METRES


def load(path: Path, resolution: float | None, *, layers: Sequence[str] = ()) -> Floor:
    """Read a drawing; ``resolution`` is the length of a unit [m], whatever the drawing says of it.

    Entities on other layers than ``layers`` are left out, if some are named, otherwise those on layers that are off
    or frozen; and so are those in paper space.
    """
    content = read_bytes(path, MAX_TEXT_BYTES)
    if not content.rstrip(b"\r\n\0 ").endswith(b"EOF"):
        raise ValueError(f"{path} has no EOF at its end; want a whole DXF drawing")
    maximum = {part: max(minimum, len(content) // _BYTES[part]) for part, minimum in _MIN_ALLOWED.items()}
    encoding = _encoding(content)
    sifted = _sift(content.decode(encoding, "surrogateescape").replace("\r\n", "\n"))
    if sifted.entities > maximum["parsed"]:
        raise ValueError(_too_dense(path, maximum["parsed"], "entities beside straight walls"))
    document = _document(path, sifted, encoding)
    unit = _unit(document)
    scale = unit if resolution is None else resolution
    if scale is None:
        raise ValueError(f"{path} has no unit; want image_resolution (--resolution), the metres of a unit")
    shows = _Layers(document, layers)
    with _damage(path):
        walls = _walls(path, document, sifted, CURVE_ERROR_M / scale, maximum["parsed"], shows)
        limited = _limited(path, walls, min(maximum["wall"], MAX_POINTS))
        segments = np.concatenate([np.zeros((0, 4)), *limited]) * scale
    if not len(segments):
        where = f"on {', '.join(map(repr, layers))}; it has {shows.named()}" if layers else "in model space"
        raise ValueError(f"{path} has no lines {where}; want a plan of {', '.join(sorted(KINDS))}")
    if (name := shows.missing()) is not None:
        raise ValueError(f"{path} has no layer {name!r}; want some of {shows.named()}")
    if not np.isfinite(segments).all():
        raise ValueError(f"{path} has lines that lead nowhere; want finite coordinates")
    wide, high = np.ptp(segments.reshape(-1, 2), axis=0).tolist()
    remarks = [f"{shows.meshes} meshes are left out"] if shows.meshes else []
    if resolution is not None or _MIN_SIDE_M <= max(wide, high) <= _MAX_SIDE_M:
        return replace(floor_of_lines(path, segments, np.zeros((0, 4))), remark="; ".join(remarks))
    remark = (
        f"by the unit of its header, {scale:g} m, the drawing is {wide:,.0f} x {high:,.0f} m; "
        "if that is wrong, give --resolution, the metres of a unit"
    )
    try:
        return replace(floor_of_lines(path, segments, np.zeros((0, 4))), remark="; ".join([*remarks, remark]))
    except ValueError as error:
        raise ValueError(f"{error}; {remark}") from error


def _encoding(content: bytes) -> str:
    """Return the encoding of a drawing: UTF-8 since release 2007 (AC1021), before that the page of its header."""
    version, page = _VERSION.search(content), _CODE_PAGE.search(content)
    if version is None or int(version[1]) >= 1021 or page is None:
        return "utf-8"
    with suppress(LookupError):
        return codecs.lookup(f"cp{page[1].decode()}").name
    return "utf-8"


def _limited(path: Path, lines: Iterable[NDArray[np.float64]], maximum: int) -> Iterator[NDArray[np.float64]]:
    """Yield the segments x1, y1, x2, y2 (n, 4) of polylines, as long as they are not too many."""
    count = 0
    for line in lines:
        count += len(line) - 1
        if count > maximum:
            raise ValueError(_too_dense(path, maximum, "straight walls"))
        yield np.hstack([line[:-1], line[1:]])


def _too_dense(path: Path, maximum: int, parts: str) -> str:
    return f"{path} has more than {maximum:,} {parts}, too many for its size; want a plan"


def _document(path: Path, sifted: _Sifted, encoding: str) -> Any:  # noqa: ANN401
    """Return the rest of a drawing; ezdxf is imported here, since few need it."""
    try:
        import ezdxf
        from ezdxf import recover
        from ezdxf.lldxf.const import DXFError
    except ImportError as error:
        raise ValueError(f"DXF drawings need ezdxf: {install_command('dxf')}") from error
    try:
        # Repairs take twice as long as reading an undamaged file.
        return ezdxf.read(io.StringIO(sifted.text))
    except (AssertionError, DXFError, *READING_ERRORS):
        pass
    with _damage(path):
        return recover.read(io.BytesIO(sifted.text.encode(encoding, "surrogateescape")))[0]


@contextmanager
def _damage(path: Path) -> Iterator[None]:
    """Name the file if ezdxf finds that it is not a drawing."""
    from ezdxf.lldxf.const import DXFError

    try:
        yield
    except (AssertionError, DXFError) as error:
        raise ValueError(f"{path} is not a DXF drawing: {error}") from error


def _unit(document: Any) -> float | None:  # noqa: ANN401
    return _METRES.get(int(document.header.get("$INSUNITS", 0)))


def _walls(
    path: Path,
    document: Any,  # noqa: ANN401
    sifted: _Sifted,
    error: float,
    maximum: int,
    shows: "_Layers",
) -> Iterator[NDArray[np.float64]]:
    """Yield the walls as polylines (n, 2) in the drawing's units."""
    from ezdxf.path import make_path

    hidden = {layer for layer in {layer for layer, _ in sifted.walls} if not shows.hold(layer)}
    yield from (wall for layer, wall in sifted.walls if layer not in hidden)
    for entity, matrix in _entities(path, document, maximum, shows):
        if entity.dxftype() == "LINE":  # paths of them cost ten times as much
            ends = entity.dxf.start, entity.dxf.end
            start, end = ends if matrix is None else map(matrix.transform, ends)
            yield np.array([(start.x, start.y), (end.x, end.y)])
            continue
        if entity.dxftype() == "POLYLINE" and (entity.is_polygon_mesh or entity.is_poly_face_mesh):
            shows.meshes += 1
            continue
        drawn = make_path(entity)
        for part in (drawn if matrix is None else drawn.transform(matrix)).sub_paths():
            line = _flattened(path, part, error)
            if len(line) > 1:
                yield line


def _flattened(path: Path, part: Any, error: float) -> NDArray[np.float64]:  # noqa: ANN401
    """Return points (n, 2) of a curve."""
    corners = np.array([tuple(point) for point in part.control_vertices()]).reshape(-1, 3)
    # If numbers are too coarse for it, parts of a curve never come near enough, and the loop does not end.
    farthest = MAX_COORDINATE_M / CURVE_ERROR_M * error
    if not (np.abs(corners) <= farthest).all():
        raise ValueError(f"{path} has a curve that reaches beyond {MAX_COORDINATE_M:,.0f} m; want a plan")
    size = float(np.ptp(corners, axis=0).max()) if len(corners) else 0.0
    points = part.flattening(max(error, CURVE_SHARE * size))
    return np.array([(point.x, point.y) for point in points]).reshape(-1, 2)


def _entities(path: Path, document: Any, maximum: int, shows: "_Layers") -> Iterator[tuple[Any, Any]]:  # noqa: ANN401
    """Yield walls with the matrix of the blocks that they are in, None if they are in none.

    A few blocks that hold each other a few times make more entities than there is time for; all are counted.
    """
    waiting: list[tuple[str, Iterator[Any], Any]] = [("0", iter(document.modelspace()), None)]
    count = 0
    while waiting:
        around, entities, matrix = waiting[-1]
        entity = next(entities, None)
        if entity is None:
            waiting.pop()
            continue
        count += len(waiting) > 1
        if count > maximum:
            raise ValueError(f"{path} has blocks of more than {maximum:,} entities; want a plan")
        if entity.dxf.get("invisible", 0):  # other states of a dynamic block
            continue
        kind = entity.dxftype()
        # What a block has on layer 0 is on the layer that the block is inserted on.
        layer = around if entity.dxf.layer == "0" else entity.dxf.layer
        if not shows.hold(layer, is_insert=kind == "INSERT"):
            continue
        if kind in COMPOUND:
            if len(waiting) > _DEEPEST:
                raise ValueError(f"{path} has blocks nested more than {_DEEPEST} deep; want a plan")
            if kind == "MLINE" or entity.mcount > 1:
                parts = entity.virtual_entities() if kind == "MLINE" else entity.multi_insert()
                waiting.append((layer, iter(parts), matrix))
            else:
                if (block := entity.block()) is None:
                    raise ValueError(
                        f"{path} is not a DXF drawing: it inserts block {entity.dxf.name!r}, which is missing"
                    )
                # ezdxf moves inserts within blocks that are scaled unevenly to wrong places.
                own = entity.matrix44()
                waiting.append((layer, iter(block), own if matrix is None else own @ matrix))
        elif kind in KINDS:
            yield entity, matrix


class _Layers:
    """The layers of a drawing whose entities count: the chosen ones, otherwise all that are on and not frozen.

    Attributes
    ----------
    meshes : int
        Meshes on them, which are left out.
    """

    def __init__(self, document: Any, chosen: Sequence[str]) -> None:  # noqa: ANN401
        self._layers = document.layers
        self._chosen = {name.lower() for name in chosen}
        self._met: set[str] = set()
        self.meshes = 0

    def hold(self, name: str, *, is_insert: bool = False) -> bool:
        """Return whether the entities of a layer count; entities of a block have layers of their own."""
        self._met.add(name.lower())
        if self._chosen and (name.lower() in self._chosen or is_insert):
            return True
        if self._chosen or name not in self._layers:
            return not self._chosen
        layer = self._layers.get(name)
        is_off = not is_insert and layer.is_off()
        return not (is_off or layer.is_frozen())

    def missing(self) -> str | None:
        """Return a chosen layer that is not in the drawing; None if all are."""
        known = {layer.dxf.name.lower() for layer in self._layers} | self._met
        return min(self._chosen - known, default=None)

    def named(self) -> str:
        """Return the names of all layers."""
        return shortened(", ".join(repr(layer.dxf.name) for layer in self._layers), _MAX_NAMED)
