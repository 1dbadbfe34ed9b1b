"""Reads DXF drawings as floors: lines, polylines and curves are walls.

Blocks are taken apart where they are inserted. The drawing's unit says how large it is.
"""

import io
import logging
import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.floors.extent import MOST_COORDINATE_M
from lidarium.envs.floors.floor import Floor
from lidarium.envs.floors.importers.common import MOST_POINTS, MOST_TEXT_BYTES, floor_of_lines
from lidarium.envs.floors.importers.dxf.sifting import COMPOUND, KINDS, Sifted, sift
from lidarium.mapping.files.guarded_reading import READING_ERRORS, read_bytes

logging.getLogger("ezdxf").addHandler(logging.NullHandler())  # else it writes each repair to the console

CURVE_ERROR_M = 0.01
"""How far the straight parts of a curve may be off it [m]."""

CURVE_SHARE = 1e-4
"""How far they may be off at least, as a share of the size of the curve."""

_METRES = {1: 0.0254, 2: 0.3048, 4: 0.001, 5: 0.01, 6: 1.0, 10: 0.9144, 14: 0.1}
"""Metres of a unit by the number that $INSUNITS has for it."""

_UNIT = re.compile(rb"\$INSUNITS\s+70\s+(\d{1,3})\s")

_LEAST_ALLOWED, _BYTES = {"wall": 25_000, "parsed": 4_000}, {"wall": 40, "parsed": 200}
"""How many straight walls and parsed entities any drawing may have, and of how many bytes one more.

Those of CAD programs take more bytes; what has so many in so few takes long, and is no plan.
"""

_DEEPEST = 16


def has_scale(path: Path) -> bool:
    """Return whether the drawing has a unit; the rest of it is not parsed for that."""
    found = _UNIT.search(read_bytes(path, MOST_TEXT_BYTES))
    return found is not None and int(found[1]) in _METRES


def load(path: Path, resolution: float | None) -> Floor:
    """Read a drawing; ``resolution`` is the length of a unit where the drawing has none [m].

    Entities on layers that are off or frozen are left out, and so is what lies in paper space.
    """
    content = read_bytes(path, MOST_TEXT_BYTES)
    if not content.rstrip(b"\r\n\0 ").endswith(b"EOF"):
        raise ValueError(f"{path} has no EOF at its end; want a whole DXF drawing")
    most = {part: max(least, len(content) // _BYTES[part]) for part, least in _LEAST_ALLOWED.items()}
    sifted = sift(content.decode("utf-8", "surrogateescape").replace("\r\n", "\n"))
    if sifted.entities > most["parsed"]:
        raise ValueError(_too_dense(path, most["parsed"], "entities beside straight walls"))
    document = _document(path, sifted)
    unit = _unit(document)
    if unit is not None and resolution is not None:
        raise ValueError(
            f"{path} has units of {unit:g} m, but a resolution of {resolution} m is given; want none"
        )
    if unit is None and resolution is None:
        raise ValueError(f"{path} has no unit; give --resolution, the metres of a unit")
    scale = resolution if unit is None else unit
    assert scale is not None
    with _damage(path):
        walls = _walls(path, document, sifted, CURVE_ERROR_M / scale, most["parsed"])
        limited = _limited(path, walls, min(most["wall"], MOST_POINTS))
        segments = np.concatenate([np.zeros((0, 4)), *limited]) * scale
    if not len(segments):
        raise ValueError(f"{path} has no lines in model space; want a plan of {', '.join(sorted(KINDS))}")
    if not np.isfinite(segments).all():
        raise ValueError(f"{path} has lines that lead nowhere; want finite coordinates")
    return floor_of_lines(path, segments, np.zeros((0, 4)))


def _limited(path: Path, lines: Iterable[NDArray[np.float64]], most: int) -> Iterator[NDArray[np.float64]]:
    """Yield the segments x1, y1, x2, y2 (n, 4) of polylines, as long as they are not too many."""
    count = 0
    for line in lines:
        count += len(line) - 1
        if count > most:
            raise ValueError(_too_dense(path, most, "straight walls"))
        yield np.hstack([line[:-1], line[1:]])


def _too_dense(path: Path, most: int, parts: str) -> str:
    return f"{path} has more than {most:,} {parts}, too many for its size; want a plan"


def _document(path: Path, sifted: Sifted) -> Any:  # noqa: ANN401
    """Return the rest of a drawing; ezdxf is imported here, since few need it."""
    try:
        import ezdxf
        from ezdxf import recover
        from ezdxf.lldxf.const import DXFError
    except ImportError as error:
        raise ValueError('DXF drawings need ezdxf; pip install "lidarium[dxf]"') from error
    try:
        # Repairs take twice as long as reading what is whole.
        return ezdxf.read(io.StringIO(sifted.text))
    except (AssertionError, DXFError, *READING_ERRORS):
        pass
    with _damage(path):
        return recover.read(io.BytesIO(sifted.text.encode("utf-8", "surrogateescape")))[0]


@contextmanager
def _damage(path: Path) -> Iterator[None]:
    """Name the file where ezdxf finds that it cannot be a drawing."""
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
    sifted: Sifted,
    error: float,
    most: int,
) -> Iterator[NDArray[np.float64]]:
    """Yield the walls as polylines (n, 2) in the drawing's units."""
    from ezdxf.path import make_path

    hidden = {layer for layer in {layer for layer, _ in sifted.walls} if not _shows(document, layer)}
    yield from (wall for layer, wall in sifted.walls if layer not in hidden)
    for entity in _entities(path, document, most):
        if entity.dxftype() == "LINE":  # paths of them cost ten times as much
            start, end = entity.dxf.start, entity.dxf.end
            yield np.array([(start.x, start.y), (end.x, end.y)])
            continue
        for part in make_path(entity).sub_paths():
            line = _flattened(path, part, error)
            if len(line) > 1:
                yield line


def _flattened(path: Path, part: Any, error: float) -> NDArray[np.float64]:  # noqa: ANN401
    """Return points (n, 2) of a curve."""
    corners = np.array([tuple(point) for point in part.control_vertices()]).reshape(-1, 3)
    # Where numbers are too coarse for it, parts of a curve never come near enough, and there is no end.
    farthest = MOST_COORDINATE_M / CURVE_ERROR_M * error
    if not (np.abs(corners) <= farthest).all():
        raise ValueError(f"{path} has a curve that reaches beyond {MOST_COORDINATE_M:,.0f} m; want a plan")
    size = float(np.ptp(corners, axis=0).max()) if len(corners) else 0.0
    points = part.flattening(max(error, CURVE_SHARE * size))
    return np.array([(point.x, point.y) for point in points]).reshape(-1, 2)


def _entities(path: Path, document: Any, most: int) -> Iterator[Any]:  # noqa: ANN401
    """Yield what is a wall, blocks taken apart.

    A few blocks that hold each other a few times make more entities than there is time for; all are counted.
    """
    waiting, count = [iter(document.modelspace())], 0
    while waiting:
        entity = next(waiting[-1], None)
        if entity is None:
            waiting.pop()
            continue
        count += len(waiting) > 1
        if count > most:
            raise ValueError(f"{path} has blocks of more than {most:,} entities; want a plan")
        kind = entity.dxftype()
        if not _shows(document, entity.dxf.layer, is_insert=kind == "INSERT"):
            continue
        if kind in COMPOUND:
            if len(waiting) > _DEEPEST:
                raise ValueError(f"{path} has blocks nested more than {_DEEPEST} deep; want a plan")
            has_rows = kind == "INSERT" and entity.mcount > 1
            waiting.append(iter(entity.multi_insert() if has_rows else entity.virtual_entities()))
        elif kind in KINDS:
            yield entity


def _shows(document: Any, name: str, *, is_insert: bool = False) -> bool:  # noqa: ANN401
    """Return whether a layer shows its entities; what a block holds has layers of its own."""
    if name not in document.layers:
        return True
    layer = document.layers.get(name)
    is_off = not is_insert and layer.is_off()
    return not (is_off or layer.is_frozen())
