"""Clouds as text: vertices of OBJ files, and lines of x, y, z."""

import re

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.point_clouds.columns import text_columns
from lidarium.mapping.point_clouds.point_cloud import PointCloud

_VERTICES = re.compile(rb"^[ \t]*v[ \t]([^\r\n]*)", re.MULTILINE)


def parse_obj(content: bytes, source: str) -> PointCloud:
    """Return the vertices of an OBJ file's bytes; faces and all else are passed over.

    Raises
    ------
    ValueError
        Where it holds no vertices, or one that is no three numbers.
    """
    return PointCloud(_coordinates(b"\n".join(_VERTICES.findall(content))), source=source)


def parse_xyz(content: bytes, source: str) -> PointCloud:
    """Return the points of lines of x, y and z, apart by blanks or commas.

    Raises
    ------
    ValueError
        Where there are none, or a line begins with something else.
    """
    return PointCloud(_coordinates(content.replace(b",", b" ").replace(b"//", b"#")), source=source)


def _coordinates(lines: bytes) -> NDArray[np.float32]:
    with np.errstate(over="ignore"):  # what is above float32 is refused as not finite
        return text_columns(lines, (0, 1, 2)).astype(np.float32)
