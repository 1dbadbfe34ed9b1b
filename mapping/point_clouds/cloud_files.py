"""Point clouds as files: PCD, PLY, OBJ, XYZ, arrays and depth images, recognised by name and content."""

import re
import struct
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.files.guarded_reading import (
    MAX_FILE_BYTES,
    open_guarded,
    read_arrays,
    read_bytes,
    reading,
)
from lidarium.mapping.files.output import write_whole
from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.point_clouds.cameras import MILLIMETRES, Intrinsics, read_depth_image
from lidarium.mapping.point_clouds.point_cloud import PointCloud

POINTS = ("x", "y", "z")
NORMALS = (("normal_x", "normal_y", "normal_z"), ("nx", "ny", "nz"))
WEIGHT = "weight"


def _wanted_columns(names: Sequence[str]) -> list[str]:
    """Return which columns of a file are read."""
    missing = [name for name in POINTS if name not in names]
    if missing:
        raise ValueError(f"it has no field {', '.join(missing)}, but {', '.join(names) or 'none'}")
    normals = next((each for each in NORMALS if all(name in names for name in each)), ())
    return [*POINTS, *normals, *([WEIGHT] if WEIGHT in names else [])]


def _cloud_of_columns(columns: Mapping[str, NDArray[np.generic]], source: str) -> PointCloud:
    """Return the cloud of columns by their names.

    Parameters
    ----------
    columns : mapping of str to (N,) array
        Those that ``_wanted_columns`` named.
    """
    normals = next((each for each in NORMALS if each[0] in columns), None)
    return PointCloud(
        _stacked(columns, POINTS),
        None if WEIGHT not in columns else columns[WEIGHT].astype(np.float32),
        None if normals is None else _stacked(columns, normals),
        source,
    )


def _stacked(columns: Mapping[str, NDArray[np.generic]], names: Sequence[str]) -> NDArray[np.float32]:
    # What is above float32 becomes inf, and is refused with all that is not finite.
    with np.errstate(over="ignore", invalid="ignore"):
        return np.stack([columns[name].astype(np.float32) for name in names], axis=1)


def _text_columns(content: bytes, places: Sequence[int], rows: int | None = None) -> NDArray[np.float64]:
    """Return columns of lines of numbers.

    Returns
    -------
    (rows, columns) float64
        The numbers.
    """
    lines = [line for line in content.splitlines() if line.strip() and not line.lstrip().startswith(b"#")]
    if not lines:
        raise ValueError("it holds no points")
    if rows is not None and len(lines) < rows:
        raise ValueError(f"it claims {rows:,} points and holds {len(lines):,} lines: truncated")
    return np.loadtxt(lines[:rows], np.float64, usecols=places, ndmin=2, encoding="ascii")


_VERTICES = re.compile(rb"^[ \t]*v[ \t]([^\r\n]*)", re.MULTILINE)


def _parse_obj(content: bytes, source: str) -> PointCloud:
    """Return the vertices of an OBJ file's bytes; faces and all else are passed over."""
    return PointCloud(_coordinates(b"\n".join(_VERTICES.findall(content))), source=source)


def _parse_xyz(content: bytes, source: str) -> PointCloud:
    """Return the points of lines of x, y and z, apart by blanks or commas."""
    return PointCloud(_coordinates(content.replace(b",", b" ").replace(b"//", b"#")), source=source)


def _coordinates(lines: bytes) -> NDArray[np.float32]:
    with np.errstate(over="ignore"):  # what is above float32 is refused as not finite
        return _text_columns(lines, (0, 1, 2)).astype(np.float32)


MAX_RATIO = 88
"""Unpacked bytes of a packed one: three packed bytes give at most 264."""


def _unpacked(packed: bytes, size: int) -> NDArray[np.uint8]:
    """Return the bytes that LZF packed.

    Returns
    -------
    (size,) uint8
        The bytes.
    """
    if size > MAX_RATIO * len(packed):
        raise ValueError(f"{len(packed):,} packed bytes claim to be {size:,} unpacked, more than LZF can pack")
    room = np.empty(size, np.uint8)
    written = _unpack(np.frombuffer(packed, np.uint8), room)
    if written != size:
        raise ValueError(f"its packed bytes are damaged, or not {size:,} when unpacked")
    return room


@kernel
def _unpack(packed: Array, room: Array) -> int:
    """Unpack bytes and return their number; -1 if they are damaged."""
    place, written = 0, 0
    while place < len(packed):
        control = int(packed[place])
        place += 1
        if control < 32:
            length = control + 1
            if place + length > len(packed) or written + length > len(room):
                return -1
            for _ in range(length):
                room[written] = packed[place]
                place += 1
                written += 1
            continue
        length = control >> 5
        if length == 7:
            if place >= len(packed):
                return -1
            length += int(packed[place])
            place += 1
        if place >= len(packed):
            return -1
        back = ((control & 31) << 8) + int(packed[place]) + 1
        place += 1
        length += 2
        if back > written or written + length > len(room):
            return -1
        for _ in range(length):
            room[written] = room[written - back]
            written += 1
    return written


MAX_HEADER = 65536
"""Most bytes of a header."""

_PCD_TYPES = {"F": "f", "I": "i", "U": "u"}
_SIZES = {"f": (4, 8), "i": (1, 2, 4, 8), "u": (1, 2, 4, 8)}
_FORMS = ("ascii", "binary", "binary_compressed")


@dataclass(frozen=True, slots=True)
class _PcdHeader:
    """Content of a header: names, kinds and counts of fields, points, form, and the offset of the points."""

    names: tuple[str, ...]
    kinds: tuple[str, ...]
    counts: tuple[int, ...]
    points: int
    form: str
    start: int

    @property
    def row(self) -> np.dtype[np.void]:
        """The numbers of a point; padding may repeat a name."""
        fields = zip(self.kinds, self.counts, strict=True)
        return np.dtype([(f"{place}", f"<{kind}", (count,)) for place, (kind, count) in enumerate(fields)])


def _parse_pcd(content: bytes, source: str) -> PointCloud:
    """Return the cloud of a PCD file's bytes."""
    header = _pcd_header(content)
    wanted = _wanted_columns(header.names)
    places = [header.names.index(name) for name in wanted]
    if any(header.counts[place] != 1 for place in places):
        raise ValueError(f"fields {', '.join(wanted)} have counts {header.counts}; want one number each")
    body = content[header.start :]
    if header.form == "ascii":
        starts = np.concatenate([[0], np.cumsum(header.counts)])
        table = _text_columns(body, [int(starts[place]) for place in places], header.points)
        columns: dict[str, NDArray[np.generic]] = dict(zip(wanted, table.T, strict=True))
    elif header.form == "binary":
        rows = np.frombuffer(_checked_size(body, header), header.row)
        columns = {name: rows[f"{place}"][:, 0] for name, place in zip(wanted, places, strict=True)}
    else:
        columns = _unpacked_columns(body, header, wanted, places)
    cloud = _cloud_of_columns(columns, source)
    return cloud.chosen(~np.isnan(cloud.points).any(axis=1))


def _checked_size(body: bytes, header: _PcdHeader) -> bytes:
    """Return the bytes of the points; the rest is ignored."""
    size = header.points * header.row.itemsize
    if size > len(body):
        raise ValueError(
            f"it claims {header.points:,} points of {header.row.itemsize} bytes and holds {len(body):,} "
            "bytes of points: truncated"
        )
    return body[:size]


def _unpacked_columns(
    body: bytes, header: _PcdHeader, wanted: list[str], places: list[int]
) -> dict[str, NDArray[np.generic]]:
    """Return columns of a compressed file: numbers of a field lie side by side."""
    if len(body) < 8:
        raise ValueError("it ends before its packed points: truncated")
    packed, size = struct.unpack("<II", body[:8])
    if packed > len(body) - 8:
        raise ValueError(f"it claims {packed:,} packed bytes and holds {len(body) - 8:,}: truncated")
    row = header.row
    if size != header.points * row.itemsize:
        raise ValueError(f"it claims {header.points:,} points of {row.itemsize} bytes, but packs {size:,} bytes")
    whole, columns, start = _unpacked(body[8 : 8 + packed], size), {}, 0
    for place, (kind, count) in enumerate(zip(header.kinds, header.counts, strict=True)):
        length = header.points * count * int(kind[1])
        if place in places:
            name = wanted[places.index(place)]
            columns[name] = np.frombuffer(whole[start : start + length].tobytes(), f"<{kind}")
        start += length
    return columns


def _pcd_header(content: bytes) -> _PcdHeader:
    """Return the content of the header."""
    said: dict[str, list[str]] = {}
    start = 0
    while "DATA" not in said:
        end = content.find(b"\n", start, MAX_HEADER)
        if end < 0:
            raise ValueError("its header has no line DATA: no PCD file, or truncated")
        words = content[start:end].decode("ascii", "replace").split()
        start = end + 1
        if words and not words[0].startswith("#"):
            said[words[0].upper()] = words[1:]
    for name in ("FIELDS", "SIZE", "TYPE"):
        if not said.get(name):
            raise ValueError(f"its header has no {name}")
    names = tuple(said["FIELDS"])
    sizes, counts = _numbers(said["SIZE"]), _numbers(said.get("COUNT", ["1"] * len(names)))
    if not len(names) == len(sizes) == len(said["TYPE"]) == len(counts):
        raise ValueError("FIELDS, SIZE, TYPE and COUNT of its header differ in length")
    kinds = tuple(f"{_PCD_TYPES.get(kind, kind)}{size}" for kind, size in zip(said["TYPE"], sizes, strict=True))
    for kind in kinds:
        if int(kind[1:]) not in _SIZES.get(kind[0], ()):
            raise ValueError(f"its header has a field of type and size {kind}, which PCD has not")
    form = " ".join(said["DATA"]).lower()
    if form not in _FORMS:
        raise ValueError(f"its DATA is {form!r}; want one of {', '.join(_FORMS)}")
    area = _numbers(said.get("WIDTH", ["0"]))[0] * _numbers(said.get("HEIGHT", ["1"]))[0]
    points = _numbers(said["POINTS"])[0] if said.get("POINTS") else area
    if points < 1:
        raise ValueError("it holds no points")
    if min(counts) < 1 or points * sum(counts) > MAX_FILE_BYTES:
        raise ValueError(f"it claims {points:,} points of {sum(counts):,} numbers; want fewer")
    return _PcdHeader(names, kinds, counts, points, form, start)


def _numbers(words: list[str]) -> tuple[int, ...]:
    """Return whole numbers that are not below 0."""
    numbers = tuple(int(word) for word in words)
    if not numbers or min(numbers) < 0:
        raise ValueError(f"its header has {' '.join(words) or 'nothing'} for numbers")
    return numbers


def write_pcd(path: Path | str, cloud: PointCloud) -> None:
    """Write a cloud as a binary PCD file, with its normals and weights."""
    names, table = ["x", "y", "z"], [cloud.points]
    if cloud.normals is not None:
        names += ["normal_x", "normal_y", "normal_z"]
        table.append(cloud.normals)
    if cloud.weights is not None:
        names.append("weight")
        table.append(cloud.weights[:, None])
    count = len(names)
    header = (
        f"# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS {' '.join(names)}\n"
        f"SIZE {' '.join(['4'] * count)}\nTYPE {' '.join(['F'] * count)}\nCOUNT {' '.join(['1'] * count)}\n"
        f"WIDTH {len(cloud)}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {len(cloud)}\nDATA binary\n"
    )
    write_whole(Path(path), header.encode() + np.concatenate(table, axis=1).astype("<f4").tobytes())


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
_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}


@dataclass(frozen=True, slots=True)
class _Element:
    """An element: its name, their number, names and kinds of its properties; None for lists."""

    name: str
    count: int
    properties: tuple[tuple[str, str | None], ...]

    def row(self, order: str) -> np.dtype[np.void]:
        """Return the numbers of one, in an order of bytes."""
        fields = [(name, f"{order}{kind}") for name, kind in self.properties if kind is not None]
        if len(fields) < len(self.properties):
            raise ValueError(f"element {self.name} holds lists and comes before or among the points")
        return np.dtype(fields)


def _parse_ply(content: bytes, source: str) -> PointCloud:
    """Return the cloud of a PLY file's bytes: its element ``vertex``."""
    order, elements, start = _ply_header(content)
    place = next((at for at, element in enumerate(elements) if element.name == "vertex"), None)
    if place is None or elements[place].count < 1:
        raise ValueError("it holds no points")
    vertices, before = elements[place], elements[:place]
    names = [name for name, _ in vertices.properties]
    wanted = _wanted_columns(names)
    row = vertices.row(order or "<")
    if not order:
        body = content[start:]
        for _ in range(sum(element.count for element in before)):
            _, _, body = body.partition(b"\n")
        table = _text_columns(body, [names.index(name) for name in wanted], vertices.count)
        columns: dict[str, NDArray[np.generic]] = dict(zip(wanted, table.T, strict=True))
        return _cloud_of_columns(columns, source)
    start += sum(element.count * element.row(order).itemsize for element in before)
    if start + vertices.count * row.itemsize > len(content):
        raise ValueError(
            f"it claims {vertices.count:,} points of {row.itemsize} bytes and holds "
            f"{max(len(content) - start, 0):,} bytes of points: truncated"
        )
    rows = np.frombuffer(content, row, vertices.count, start)
    return _cloud_of_columns({name: rows[name] for name in wanted}, source)


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
    kind = None if words[1] == "list" else _PLY_TYPES[words[1]]
    return _Element(element.name, element.count, (*element.properties, (words[-1], kind)))


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


LARGEST_EXTENT = 1000.0
"""Largest extent that is taken for metres [m]."""

KINDS = {
    ".pcd": "PCD",
    ".ply": "PLY",
    ".obj": "OBJ",
    ".xyz": "XYZ",
    ".txt": "XYZ",
    ".npz": "NPZ",
    ".pgm": "PGM",
    ".png": "PNG",
}
"""Type of a file by the end of its name."""

_PARSERS: dict[str, Callable[[bytes, str], PointCloud]] = {
    "PCD": _parse_pcd,
    "PLY": _parse_ply,
    "OBJ": _parse_obj,
    "XYZ": _parse_xyz,
}
_BEGINNINGS = {
    b"# .PCD": "PCD",
    b"VERSION": "PCD",
    b"ply": "PLY",
    b"P5": "PGM",
    b"\x89PNG": "PNG",
    b"PK": "NPZ",
}
_COORDINATES = "xyz"


def read_cloud(
    path: Path | str,
    scale: float | None = None,
    intrinsics: Intrinsics | tuple[float, float, float, float] | None = None,
    pose: Path | str | None = None,
) -> PointCloud:
    """Read a point cloud, or the points of a depth image.

    Parameters
    ----------
    path : Path or str
        A PCD, PLY, OBJ, XYZ or NPZ file (an array ``xyz``), or a depth image (PGM, PNG).
    scale : float, optional
        Length of a unit of the file [m]; by default 1, and 0.001 for depth images.
    intrinsics : Intrinsics or (float, float, float, float), optional
        fx, fy, cx, cy of the camera [pixels]; needed for depth images.
    pose : Path or str, optional
        A text file of 4 x 4 numbers, the pose of a depth image; by default the camera's own frame.

    Returns
    -------
    PointCloud
        ``points`` (N, 3) float32 [m], all of them finite.

    Raises
    ------
    FileNotFoundError
        If the file does not exist.
    ValueError
        If the type is not the one of the file's name, the file is truncated or has no points, or points are
        not finite or more than a kilometre apart.

    Examples
    --------
    >>> import lidarium, numpy as np, tempfile
    >>> folder = tempfile.mkdtemp()
    >>> np.savez(f"{folder}/cloud.npz", xyz=np.eye(3, dtype=np.float32))
    >>> lidarium.read_cloud(f"{folder}/cloud.npz").points.shape
    (3, 3)
    """
    path = Path(path)
    kind = _kind_of(path)
    if scale is not None and not 0.0 < scale < np.inf:
        raise ValueError(f"scale of {path} is {scale}; want a number above 0")
    if kind in ("PGM", "PNG"):
        if intrinsics is None:
            raise ValueError(f"{path} is a depth image; want the intrinsics of its camera")
        camera = Intrinsics(*intrinsics) if isinstance(intrinsics, tuple) else intrinsics
        return _checked_cloud(read_depth_image(path, camera, scale or MILLIMETRES, pose))
    if kind == "NPZ":
        cloud = _read_npz(path)
    else:
        with reading(path, f"a whole {kind} file"):
            cloud = _PARSERS[kind](read_bytes(path), str(path))
    if scale is not None:
        cloud = PointCloud(cloud.points * np.float32(scale), cloud.weights, cloud.normals, cloud.source)
    return _checked_cloud(cloud)


def _kind_of(path: Path) -> str:
    """Return the type of a file by its name and beginning, which have to agree."""
    with open_guarded(path) as file:
        begin = file.read(16)
    named = KINDS.get(path.suffix.lower())
    found = next((kind for start, kind in _BEGINNINGS.items() if begin.startswith(start)), None)
    if found is not None and named not in (None, found):
        raise ValueError(f"{path} is named as {named} and holds {found}; want a name that tells")
    kind = found or named
    if kind is None:
        raise ValueError(f"{path} is no cloud that is known; want {', '.join(sorted(KINDS))}")
    return kind


def _checked_cloud(cloud: PointCloud) -> PointCloud:
    """Return a cloud that has points, all of them finite and near in metres."""
    points = cloud.points
    if len(points) == 0:
        raise ValueError(f"{cloud.source} holds no points")
    lost = int((~np.isfinite(points).all(axis=1)).sum())
    if lost:
        raise ValueError(f"{cloud.source} holds {lost:,} points of nan or inf; want finite coordinates")
    extent = float((points.max(axis=0).astype(np.float64) - points.min(axis=0)).max())
    if extent > LARGEST_EXTENT:
        raise ValueError(
            f"{cloud.source} extends over {extent:,.0f} m, so that its units are hardly metres; for "
            "millimetres give scale 0.001"
        )
    return cloud


def _read_npz(path: Path) -> PointCloud:
    """Read the array ``xyz`` of an NPZ file."""
    arrays = read_arrays(path, "a whole NPZ file")
    if not isinstance(arrays, dict) or _COORDINATES not in arrays:
        raise ValueError(f"{path} holds no array {_COORDINATES}; want points of shape (N, 3)")
    with reading(path, "a cloud"):
        return PointCloud(arrays[_COORDINATES].astype(np.float32), source=str(path))
