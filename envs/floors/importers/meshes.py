"""Vertices of meshes in STL and OBJ, for their bounding boxes."""

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.files.guarded_reading import read_bytes, reading

_MAX_MESH_BYTES = 64 << 20
_STL_HEADER, _STL_FACET = 84, 50
_VERTICES = re.compile(rb"^[ \t]*v(?:ertex)?[ \t]+(\S+)[ \t]+(\S+)[ \t]+(\S+)", re.MULTILINE)


def vertices_of_mesh(path: Path) -> NDArray[np.float64] | None:
    """Return the vertices of a mesh, (n, 3) [m]; None if it is of another format."""
    if path.suffix.lower() not in (".stl", ".obj"):
        return None
    content = read_bytes(path, _MAX_MESH_BYTES)
    with reading(path, "a mesh"):
        count = int.from_bytes(content[80:_STL_HEADER], "little")
        if path.suffix.lower() == ".stl" and len(content) == _STL_HEADER + count * _STL_FACET:
            facets = np.frombuffer(content, np.dtype([("numbers", "<f4", 12), ("other", "<u2")]), offset=_STL_HEADER)
            vertices = facets["numbers"][:, 3:].reshape(-1, 3).astype(np.float64)
        else:
            vertices = np.array(_VERTICES.findall(content)).astype(np.float64).reshape(-1, 3)
        if not len(vertices) or not np.isfinite(vertices).all():
            raise ValueError("it has no vertices, or some that are not finite")
    return vertices
