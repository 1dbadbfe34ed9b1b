"""PLY files: text, little endian, big endian."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.files.guarded_reading import MOST_FILE_BYTES
from lidarium.mapping.files.output import write_whole
from lidarium.mapping.point_clouds.columns import cloud_of_columns, text_columns, wanted_columns
from lidarium.mapping.point_clouds.point_cloud import PointCloud

MOST_HEADER = 65536
"""Most bytes of a header."""

_KINDS = {
    "char": "i1",
    "uchar": "u1",
    "short": "i2",
    "ushort": "u2",
    "int": "i4",
    "uint": "u4",
    "float": "f4",
    "double": "f8",
    "int8": "i1",
    "uint8": "u1",
    "int16": "i2",
    "uint16": "u2",
    "int32": "i4",
    "uint32": "u4",
    "float32": "f4",
    "float64": "f8",
}
_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}


@dataclass(frozen=True, slots=True)
class _Element:
    """An element: its name, how many there are, names and kinds of its properties; None for lists."""

    name: str
    count: int
    properties: tuple[tuple[str, str | None], ...]

    def row(self, order: str) -> np.dtype[np.void]:
        """Return the numbers of one, in an order of bytes."""
        fields = [(name, f"{order}{kind}") for name, kind in self.properties if kind is not None]
        if len(fields) < len(self.properties):
            raise ValueError(f"element {self.name} holds lists and comes before or among the points")
        return np.dtype(fields)


def parse_ply(content: bytes, source: str) -> PointCloud:
    """Return the cloud of a PLY file's bytes: its element ``vertex``.

    Raises
    ------
    ValueError
        Where it is none, truncated, or claims more than it holds.
    """
    order, elements, start = _header_of(content)
    place = next((at for at, element in enumerate(elements) if element.name == "vertex"), None)
    if place is None or elements[place].count < 1:
        raise ValueError("it holds no points")
    vertices, before = elements[place], elements[:place]
    names = [name for name, _ in vertices.properties]
    wanted = wanted_columns(names)
    row = vertices.row(order or "<")
    if not order:
        body = content[start:]
        for _ in range(sum(element.count for element in before)):
            _, _, body = body.partition(b"\n")
        table = text_columns(body, [names.index(name) for name in wanted], vertices.count)
        columns: dict[str, NDArray[np.generic]] = dict(zip(wanted, table.T, strict=True))
        return cloud_of_columns(columns, source)
    start += sum(element.count * element.row(order).itemsize for element in before)
    if start + vertices.count * row.itemsize > len(content):
        raise ValueError(
            f"it claims {vertices.count:,} points of {row.itemsize} bytes and holds "
            f"{max(len(content) - start, 0):,} bytes of points: truncated"
        )
    rows = np.frombuffer(content, row, vertices.count, start)
    return cloud_of_columns({name: rows[name] for name in wanted}, source)


def _header_of(content: bytes) -> tuple[str, list[_Element], int]:
    """Return the order of bytes, the elements, and where they begin."""
    end = content.find(b"end_header", 0, MOST_HEADER)
    line_end = content.find(b"\n", end)
    if not content.startswith(b"ply") or end < 0 or line_end < 0:
        raise ValueError("its header has no line end_header: no PLY file, or truncated")
    order, elements = None, []
    for line in content[:end].decode("ascii", "replace").splitlines()[1:]:
        words = line.split()
        if not words or words[0] in ("comment", "obj_info"):
            continue
        if words[0] == "format" and len(words) > 1:
            order = _ORDERS.get(words[1])
        elif words[0] == "element" and len(words) == 3:
            elements.append(_Element(words[1], _count_of(words[2]), ()))
        elif words[0] == "property" and elements and len(words) > 2:
            elements[-1] = _with_property(elements[-1], words)
        else:
            raise ValueError(f"its header has the line {line!r}")
    if order is None:
        raise ValueError(f"its header has no format of {', '.join(_ORDERS)}")
    return order, elements, line_end + 1


def _count_of(word: str) -> int:
    count = int(word)
    if not 0 <= count <= MOST_FILE_BYTES:
        raise ValueError(f"it claims {count:,} elements")
    return count


def _with_property(element: _Element, words: list[str]) -> _Element:
    """Return an element with one more property."""
    if words[1] != "list" and words[1] not in _KINDS:
        raise ValueError(f"its header has a property of type {words[1]}, which PLY has not")
    kind = None if words[1] == "list" else _KINDS[words[1]]
    return _Element(element.name, element.count, (*element.properties, (words[-1], kind)))


def write_ply(path: Path | str, cloud: PointCloud) -> None:
    """Write a cloud as a binary PLY file, with its normals and weights.

    Raises
    ------
    OSError
        Where nothing can be written there.
    """
    names, table = ["x", "y", "z"], [cloud.points]
    if cloud.normals is not None:
        names += ["nx", "ny", "nz"]
        table.append(cloud.normals)
    if cloud.weights is not None:
        names.append("weight")
        table.append(cloud.weights[:, None])
    properties = "".join(f"property float {name}\n" for name in names)
    header = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(cloud)}\n{properties}end_header\n"
    write_whole(Path(path), header.encode() + np.concatenate(table, axis=1).astype("<f4").tobytes())
