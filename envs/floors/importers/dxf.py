"""Plans as DXF drawings: lines, polylines and curves are walls.

Blocks are taken apart where they are inserted. The drawing's unit says how large it is.
"""

import io
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.floors.floor import Floor
from lidarium.envs.floors.importers.common import MOST_TEXT_BYTES, floor_of_lines
from lidarium.mapping.files.guarded_reading import read_bytes

CURVE_ERROR_M = 0.01
"""How far the straight parts of a curve may be off it [m]."""

_METRES = {1: 0.0254, 2: 0.3048, 4: 0.001, 5: 0.01, 6: 1.0, 10: 0.9144, 14: 0.1}
"""Metres of a unit by the number that $INSUNITS has for it."""

_KINDS = frozenset(("LINE", "LWPOLYLINE", "POLYLINE", "ARC", "CIRCLE", "ELLIPSE", "SPLINE"))
"""Entities that are walls; texts, dimensions, hatches and the like are none."""


def has_scale(path: Path) -> bool:
    """Return whether the drawing has a unit."""
    return _unit(_document(path)) is not None


def load(path: Path, resolution: float | None) -> Floor:
    """Read a drawing; ``resolution`` is the length of a unit where the drawing has none [m].

    Entities on layers that are off or frozen are left out, and so is what lies in paper space.
    """
    document = _document(path)
    unit = _unit(document)
    if unit is not None and resolution is not None:
        raise ValueError(
            f"{path} has units of {unit:g} m, but a resolution of {resolution} m is given; want none"
        )
    if unit is None and resolution is None:
        raise ValueError(f"{path} has no unit; give --resolution, the metres of a unit")
    scale = resolution if unit is None else unit
    assert scale is not None
    lines = [line for line in _lines(document, CURVE_ERROR_M / scale) if len(line) > 1]
    if not lines:
        raise ValueError(f"{path} has no lines in model space; want a plan of {', '.join(sorted(_KINDS))}")
    segments = np.concatenate([np.hstack([line[:-1], line[1:]]) for line in lines]) * scale
    if not np.isfinite(segments).all():
        raise ValueError(f"{path} has lines that lead nowhere; want finite coordinates")
    return floor_of_lines(path, segments, np.zeros((0, 4)))


def _document(path: Path) -> Any:  # noqa: ANN401
    """Return the drawing; ezdxf is imported here, since few need it."""
    try:
        from ezdxf import recover
        from ezdxf.lldxf.const import DXFError
    except ImportError as error:
        raise ValueError('DXF drawings need ezdxf; pip install "lidarium[dxf]"') from error
    content = read_bytes(path, MOST_TEXT_BYTES)
    if not content.rstrip(b"\r\n\0 ").endswith(b"EOF"):
        raise ValueError(f"{path} has no EOF at its end; want a whole DXF drawing")
    try:
        return recover.read(io.BytesIO(content))[0]
    except DXFError as error:
        raise ValueError(f"{path} is not a DXF drawing: {error}") from error


def _unit(document: Any) -> float | None:  # noqa: ANN401
    return _METRES.get(int(document.header.get("$INSUNITS", 0)))


def _lines(document: Any, error: float) -> Iterator[NDArray[np.float64]]:  # noqa: ANN401
    """Yield the walls as polylines (n, 2) in the drawing's units."""
    from ezdxf import disassemble, path

    for entity in disassemble.recursive_decompose(document.modelspace()):
        layer = document.layers.get(entity.dxf.layer) if entity.dxf.layer in document.layers else None
        if entity.dxftype() not in _KINDS or (layer is not None and (layer.is_off() or layer.is_frozen())):
            continue
        for part in path.make_path(entity).sub_paths():
            yield np.array([(point.x, point.y) for point in part.flattening(error)]).reshape(-1, 2)
