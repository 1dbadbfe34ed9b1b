"""Clouds and meshes as PLY files.

References
----------
G. Turk, "The PLY Polygon File Format", Stanford University, 1994.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.files.guarded_reading import MAX_FILE_BYTES
from lidarium.mapping.files.output import write_whole
from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.point_clouds.columns import Content, cloud_of_columns, text_columns, wanted_columns
from lidarium.mapping.point_clouds.faces import triangles_of
from lidarium.mapping.point_clouds.point_cloud import PointCloud

MAX_HEADER = 65536
"""Most bytes of a header."""

_PLY_TYPES = {
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
_CORNERS = ("vertex_indices", "vertex_index")
_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}


@dataclass(frozen=True, slots=True)
class _Element:
    """An element: its name, their number, names and kinds of its properties, and kinds of the counts of lists."""

    name: str
    count: int
    properties: tuple[tuple[str, str, str], ...]

    @property
    def least_bytes(self) -> int:
        """Bytes of one if its lists are empty."""
        return sum(int((counts or kind)[1]) for _, kind, counts in self.properties)

    def row(self, order: str) -> np.dtype[np.void]:
        """Return the numbers of one, in an order of bytes."""
        fields = [(name, f"{order}{kind}") for name, kind, counts in self.properties if not counts]
        if len(fields) < len(self.properties):
            raise ValueError(f"element {self.name} holds lists and comes before or among the points")
        return np.dtype(fields)


def parse_ply(content: bytes) -> Content:
    """Return the content of a PLY file's bytes: its elements ``vertex`` and ``face``."""
    order, elements, start = _ply_header(content)
    place = next((at for at, element in enumerate(elements) if element.name == "vertex"), None)
    if place is None or elements[place].count < 1:
        raise ValueError("it holds no points")
    vertices, before = elements[place], elements[:place]
    names = [name for name, *_ in vertices.properties]
    wanted = wanted_columns(names)
    row = vertices.row(order or "<")
    if order:
        # What is before the points has a fixed size, or is refused.
        start += sum(element.count * element.row(order).itemsize for element in before)
    there = len(content) - start if order else content.count(b"\n", start) + 1
    if vertices.count * (row.itemsize if order else 1) > there:
        what = f"points of {row.itemsize} bytes and holds {max(there, 0):,} bytes" if order else "lines"
        raise ValueError(f"it claims {vertices.count:,} {what} of points: truncated")
    # No element takes less than a byte, or a line.
    least = sum(each.count * (max(each.least_bytes, 1) if order else 1) for each in elements[place + 1 :])
    if least > len(content):
        raise ValueError(f"it claims {sum(each.count for each in elements):,} elements in {len(content):,} bytes")
    if not order:
        lines = content[start:].split(b"\n")[sum(element.count for element in before) :]
        _check_rest(b"\n".join(lines[sum(each.count for each in elements[place:]) :]).strip(), 1, vertices.count)
        table = text_columns(b"\n".join(lines), [names.index(name) for name in wanted], vertices.count)
        columns: dict[str, NDArray[np.generic]] = dict(zip(wanted, table.T, strict=True))
        found = cloud_of_columns(columns)
        polygons = _text_faces(lines[vertices.count :], elements[place + 1 :])
    else:
        if not any(counts for each in elements[place + 1 :] if each.count for *_, counts in each.properties):
            end = start + sum(each.count * each.least_bytes for each in elements[place:])
            _check_rest(content[end:], row.itemsize, vertices.count)
        rows = np.frombuffer(content, row, vertices.count, start)
        found = cloud_of_columns({name: rows[name] for name in wanted})
        polygons = _binary_faces(content, start + vertices.count * row.itemsize, order, elements[place + 1 :])
    return replace(found, triangles=triangles_of(polygons, vertices.count))


def _check_rest(rest: bytes, point: int, count: int) -> None:
    """Refuse a file with more after its last element than a point takes [bytes]: its counts are wrong."""
    if len(rest) >= point:
        raise ValueError(f"it claims {count:,} points, and {len(rest):,} bytes are left after its last element")


def _faces_among(elements: list[_Element]) -> tuple[list[_Element], _Element | None]:
    """Return the elements before the faces, and the faces; None if there are none."""
    place = next((at for at, each in enumerate(elements) if each.name == "face" and each.count), len(elements))
    faces = elements[place] if place < len(elements) else None
    if faces is not None and not any(name in _CORNERS and counts for name, _, counts in faces.properties):
        faces = None
    return elements[:place], faces


def _text_faces(lines: list[bytes], elements: list[_Element]) -> list[NDArray[np.int64]]:
    """Return the polygons of faces as lines, grouped by their number of corners."""
    before, faces = _faces_among(elements)
    if faces is None:
        return []
    first = sum(each.count for each in before)
    if first + faces.count > len(lines):
        raise ValueError(f"it claims {faces.count:,} faces and holds {max(len(lines) - first, 0):,} lines: truncated")
    groups: dict[int, list[list[int]]] = {}
    for line in lines[first : first + faces.count]:
        words = line.split()
        for name, _, counts in faces.properties:
            length = int(words[0]) if counts else 1
            if name in _CORNERS and counts:
                groups.setdefault(length, []).append([int(word) for word in words[1 : 1 + length]])
            words = words[length + bool(counts) :]
    return [np.array(group, np.int64).reshape(len(group), length) for length, group in groups.items()]


def _binary_faces(content: bytes, start: int, order: str, elements: list[_Element]) -> list[NDArray[np.int64]]:
    """Return the polygons of faces as bytes, grouped by their number of corners."""
    before, faces = _faces_among(elements)
    if faces is None:
        return []
    start += sum(each.count * each.row(order).itemsize for each in before)
    body = np.frombuffer(content, np.uint8)
    # Bytes of each property, and of the number of its values if it is a list.
    sizes = np.array([(int(kind[1]), int(counts[1]) if counts else 0) for _, kind, counts in faces.properties])
    wanted = next(at for at, (name, _, counts) in enumerate(faces.properties) if name in _CORNERS and counts)
    found = np.empty((faces.count, 2), np.int64)
    if not _find_lists(body, start, sizes, wanted, order == "<", found):
        raise ValueError(f"it claims {faces.count:,} faces and ends before their last: truncated")
    size, kind = int(sizes[wanted, 0]), np.dtype(f"{order}{faces.properties[wanted][1]}")
    polygons = []
    for length in np.unique(found[:, 1]):
        places = found[found[:, 1] == length, 0]
        values = body[places[:, None] + np.arange(length * size)]
        polygons.append(np.ascontiguousarray(values).view(kind).reshape(len(places), length).astype(np.int64))
    return polygons


@kernel
def _find_lists(body: Array, start: int, sizes: Array, wanted: int, is_little: bool, found: Array) -> bool:
    """Write place and length of a list of each element; return whether all of them are within the bytes."""
    place = start
    for i in range(len(found)):
        for k in range(len(sizes)):
            length = 1
            if sizes[k, 1] > 0:
                if place + sizes[k, 1] > len(body):
                    return False
                length = 0
                for byte in range(sizes[k, 1]):
                    shift = 8 * (byte if is_little else sizes[k, 1] - 1 - byte)
                    length |= int(body[place + byte]) << shift
                place += sizes[k, 1]
            if length < 0 or length > len(body):
                return False
            if k == wanted:
                found[i, 0], found[i, 1] = place, length
            place += length * sizes[k, 0]
            if place > len(body):
                return False
    return True


def _ply_header(content: bytes) -> tuple[str, list[_Element], int]:
    """Return the order of bytes, the elements, and the offset of their values."""
    end = content.find(b"end_header", 0, MAX_HEADER)
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
    if not 0 <= count <= MAX_FILE_BYTES:
        raise ValueError(f"it claims {count:,} elements")
    return count


def _with_property(element: _Element, words: list[str]) -> _Element:
    """Return an element with one more property."""
    if words[1] != "list" and words[1] not in _PLY_TYPES:
        raise ValueError(f"its header has a property of type {words[1]}, which PLY has not")
    counts, kind = ("", words[1]) if words[1] != "list" else (words[2], words[-2])
    if kind not in _PLY_TYPES or _PLY_TYPES.get(counts, "f" if counts else "u")[0] == "f":
        raise ValueError(f"its header has a list of {counts} and {kind}, which PLY has not")
    described = (words[-1], _PLY_TYPES[kind], _PLY_TYPES[counts] if counts else "")
    return _Element(element.name, element.count, (*element.properties, described))


def write_ply(path: Path | str, cloud: PointCloud) -> None:
    """Write a cloud as a binary PLY file, with its normals and weights."""
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
