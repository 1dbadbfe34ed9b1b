"""Point clouds as files: PCD, PLY, OBJ, XYZ, arrays, scans and depth images, recognised by name and content."""

import itertools
import re
import struct
from collections.abc import Callable, Sequence
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
    without_mark,
)
from lidarium.mapping.files.output import write_whole
from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.point_clouds.cameras import MILLIMETRES, Intrinsics, read_depth_image
from lidarium.mapping.point_clouds.columns import POINTS, Content, cloud_of_columns, text_columns, wanted_columns
from lidarium.mapping.point_clouds.faces import SPACING_M, sampled, triangles_of
from lidarium.mapping.point_clouds.ply_files import MAX_HEADER, parse_ply
from lidarium.mapping.point_clouds.point_cloud import PointCloud
from lidarium.mapping.point_clouds.survey_files import read_e57, read_las

_VERTICES = re.compile(rb"^[ \t]*v(?![^ \t\r\n])([^\r\n]*)", re.MULTILINE)
_FACES = re.compile(rb"^[ \t]*f[ \t]([^\r\n]*)", re.MULTILINE)
# Wavefront Technologies, "Advanced Visualizer Manual", appendix B1, "Object Files (.obj)".
_OBJ_WORDS = frozenset(
    b"v vt vn vp vc cstype deg bmat step p l f fo curv curv2 surf parm trim hole scrv sp end con g s mg o bevel lod "
    b"c_interp d_interp usemap maplib usemtl mtllib shadow_obj trace_obj ctech stech call csh".split()
)
_DECIMAL_COMMA = re.compile(rb"[-+]?\d*,\d+(?:[eE][-+]?\d+)?")
_CHECKED_LINES = 100


def _parse_obj(content: bytes) -> Content:
    """Return the vertices and faces of an OBJ file's bytes; its other elements are passed over."""
    content = content.replace(b"\\\r\n", b" ").replace(b"\\\n", b" ")
    vertices = [line.split(b"#")[0].split() for line in _VERTICES.findall(content)]
    lengths = np.array([len(words) for words in vertices], np.int64)
    if (lengths < 3).any():
        raise ValueError(
            f"{np.count_nonzero(lengths < 3):,} of its {len(lengths):,} vertices have less than three columns: damaged?"
        )
    points = text_columns(b"\n".join(b" ".join(words[:3]) for words in vertices), (0, 1, 2))
    polygons, counts = _faces_of(content)
    return Content(points, triangles=triangles_of(polygons, len(points)), remarks=_doubts_of(content, lengths, counts))


def _faces_of(content: bytes) -> tuple[list[NDArray[np.int64]], NDArray[np.int64]]:
    """Return the corners of an OBJ file's faces, grouped by their number, (m, corners) each, and all these numbers."""
    lines = [line.split(b"#", 1)[0] for line in _FACES.findall(content)]
    counts = np.array([len(line.split()) for line in lines], np.int64)
    # A corner is a vertex, and perhaps a texture and a normal after slashes.
    words = re.sub(rb"/\S*", b"", b" ".join(lines)).split()
    if len(words) != counts.sum():
        raise ValueError("corners of its faces name no vertex: damaged?")
    corners = np.array(list(map(int, words)), np.int64)
    if corners.min(initial=0) < 0:  # the last vertex before the face is -1
        vertices, faces = (np.array([each.start() for each in form.finditer(content)]) for form in (_VERTICES, _FACES))
        before = np.repeat(np.searchsorted(vertices, faces), counts)
        corners = np.where(corners < 0, corners + before + 1, corners)
    firsts = np.cumsum(counts) - counts
    groups = [firsts[counts == count][:, None] + np.arange(count) for count in np.unique(counts)]
    return [corners[group] - 1 for group in groups], counts


def _doubts_of(content: bytes, lengths: NDArray[np.int64], corners: NDArray[np.int64]) -> tuple[str, ...]:
    """Say which lines of an OBJ file are none, and how many vertices and faces are of other lengths."""
    remarks = []
    lines = [line.split(b"#", 1)[0].split(None, 1) for line in content.splitlines()]
    strange = [number for number, words in enumerate(lines, 1) if words and words[0] not in _OBJ_WORDS]
    if strange:
        remarks.append(f"{len(strange):,} lines are no OBJ and passed over, the first is line {strange[0]:,}: damaged?")
    usual = int(np.bincount(lengths).argmax())
    if others := int(np.count_nonzero(lengths != usual)):
        remarks.append(f"{others:,} of {len(lengths):,} vertices have not {usual} numbers as most: damaged?")
    if short := int(np.count_nonzero(corners < 3)):
        remarks.append(f"{short:,} faces have fewer than three corners and are passed over: damaged?")
    return tuple(remarks)


def _parse_xyz(content: bytes) -> Content:
    """Return the points of lines of x, y and z, apart by blanks, commas or semicolons."""
    content, places = _without_header(content)
    content = content.replace(b"//", b"#").replace(b";", b" ")
    remarks: tuple[str, ...] = ()
    if b"," in content:
        lines = [line.split(b"#")[0] for line in content.splitlines() if line.strip() and line.lstrip()[:1] != b"#"]
        words = [line.split() for line in lines[:_CHECKED_LINES]]
        has_decimals = [any(_DECIMAL_COMMA.fullmatch(word) for word in line) for line in words]
        if any(len(line) >= 3 and has for line, has in zip(words, has_decimals, strict=True)):
            if b"." in b"".join(itertools.chain.from_iterable(words)):
                raise ValueError("it has points and commas within numbers; want decimal points, and one separator")
            content, remarks = content.replace(b",", b"."), ("commas are taken for decimal points",)
        elif any(re.search(rb",0\d", line) for line in lines[:_CHECKED_LINES]) and b"." not in content:
            raise ValueError("its commas part numbers such as 05, as those after a decimal comma; want decimal points")
        else:
            content = content.replace(b",", b" ")
    return Content(text_columns(content, places), remarks=remarks)


def _without_header(content: bytes) -> tuple[bytes, Sequence[int]]:
    """Return lines of numbers without a header, and the places of x, y and z in them.

    A header names columns, as CloudCompare's (``//X Y Z R G B``), or counts the points, as in PTS files.
    """
    places: Sequence[int] = (0, 1, 2)
    for _ in range(2):
        line, _, rest = content.lstrip().partition(b"\n")
        words = re.split(rb"[\s,;]+", line.strip().lstrip(b"/# ").lower())
        if all(name in words for name in (b"x", b"y", b"z")):
            content, places = rest, [words.index(name) for name in (b"x", b"y", b"z")]
        elif len(words) == 1 and words[0].isdigit() and rest.strip():
            count, lines = int(words[0]), sum(1 for each in rest.splitlines() if each.strip())
            if count != lines:
                raise ValueError(f"its first line claims {count:,} points, and {lines:,} lines follow: truncated?")
            content = rest
    return content, places


def _parse_bin(content: bytes) -> Content:
    """Return the points of a laser scan of KITTI: x, y, z and intensity, single precision."""
    if len(content) % 16:
        raise ValueError(f"it has {len(content):,} bytes; want a multiple of 16: x, y, z and intensity of each point")
    return Content(np.frombuffer(content, "<f4").reshape(-1, 4)[:, :3].astype(np.float32))


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


def _parse_pcd(content: bytes) -> Content:
    """Return the content of a PCD file's bytes."""
    header = _pcd_header(content)
    wanted = wanted_columns(header.names)
    places = [header.names.index(name) for name in wanted]
    if any(header.counts[place] != 1 for place in places):
        raise ValueError(f"fields {', '.join(wanted)} have counts {header.counts}; want one number each")
    body = content[header.start :]
    if header.form == "ascii":
        starts = np.concatenate([[0], np.cumsum(header.counts)])
        table = text_columns(body, [int(starts[place]) for place in places], header.points)
        columns: dict[str, NDArray[np.generic]] = dict(zip(wanted, table.T, strict=True))
    elif header.form == "binary":
        rows = np.frombuffer(_checked_size(body, header), header.row)
        columns = {name: rows[f"{place}"][:, 0] for name, place in zip(wanted, places, strict=True)}
    else:
        columns = _unpacked_columns(body, header, wanted, places)
    there = ~np.isnan(np.stack([columns[name] for name in POINTS])).any(axis=0)
    return cloud_of_columns({name: column[there] for name, column in columns.items()})


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
    if said.get("WIDTH") and area != points:
        raise ValueError(f"its header has {area:,} points by WIDTH and HEIGHT, and {points:,} by POINTS")
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


FAR = 4096.0
"""Coordinates beyond it lose digits in single precision: an offset is taken off."""

_FARTHEST = 1e10
"""Coordinates beyond it are no places."""

_COARSE = 0.001
"""Steps of coordinates that are told."""

LARGEST_EXTENT = 1000.0
"""Largest extent that is taken for metres [m]."""

KINDS = {
    ".pcd": "PCD",
    ".ply": "PLY",
    ".obj": "OBJ",
    ".xyz": "XYZ",
    ".txt": "XYZ",
    ".asc": "XYZ",
    ".csv": "XYZ",
    ".pts": "XYZ",
    ".npz": "NPZ",
    ".npy": "NPZ",
    ".bin": "BIN",
    ".las": "LAS",
    ".laz": "LAS",
    ".e57": "E57",
    ".pgm": "PGM",
    ".png": "PNG",
}
"""Type of a file by the end of its name."""

_PARSERS: dict[str, Callable[[bytes], Content]] = {
    "PCD": _parse_pcd,
    "PLY": parse_ply,
    "OBJ": _parse_obj,
    "XYZ": _parse_xyz,
    "BIN": _parse_bin,
}
_READERS: dict[str, Callable[[Path], Content]] = {"LAS": read_las, "E57": read_e57}
_BEGINNINGS = {
    b"# .PCD": "PCD",
    b"VERSION": "PCD",
    b"ply": "PLY",
    b"P5": "PGM",
    b"\x89PNG": "PNG",
    b"PK": "NPZ",
    b"\x93NUMPY": "NPZ",
    b"LASF": "LAS",
    b"ASTM-E57": "E57",
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
        A PCD, PLY, OBJ, XYZ, PTS, NPY or NPZ file (an array ``xyz``), a scan of KITTI (``.bin``), a LAS, LAZ or E57
        file (extra ``clouds``), or a depth image (PGM, PNG).
    scale : float, optional
        Length of a unit of the file [m]; by default 1, and 0.001 for depth images.
    intrinsics : Intrinsics or (float, float, float, float), optional
        fx, fy, cx, cy of the camera [pixels]; needed for depth images.
    pose : Path or str, optional
        A text file of 4 x 4 numbers, the pose of a depth image; by default the camera's own frame.

    Returns
    -------
    PointCloud
        ``points`` (N, 3) float32 [m], all of them finite; ``offset`` (3,) is to be added if they are far from the
        origin of the file. Faces of meshes have points 2 cm apart.

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
        camera = intrinsics if isinstance(intrinsics, Intrinsics) else Intrinsics(*_four_numbers(intrinsics))
        return _checked_cloud(read_depth_image(path, camera, scale or MILLIMETRES, pose))
    if kind == "NPZ":
        content = _read_npz(path)
    elif kind in _READERS:
        content = _READERS[kind](path)
    else:
        with reading(path, f"a whole {kind} file"):
            content = _PARSERS[kind](without_mark(read_bytes(path)))
    return _cloud_of(content, scale, str(path))


def _four_numbers(given: Sequence[float]) -> list[float]:
    numbers = np.asarray(given, np.float64).ravel().tolist()
    if len(numbers) != 4:
        raise ValueError(f"intrinsics are {numbers}; want the four numbers fx, fy, cx and cy")
    return [float(number) for number in numbers]


def _cloud_of(content: Content, scale: float | None, source: str) -> PointCloud:
    """Return the cloud of a file in metres: near the origin, with points on its faces, and without zeros."""
    remarks = list(content.remarks)
    points, weights, normals = content.points, content.weights, content.normals
    if not len(content.triangles):
        # Sensors write no return as zeros; a single one may be a point.
        is_zero = (points == 0.0).all(axis=1)
        if 1 < (zeros := int(np.count_nonzero(is_zero))) < len(points):
            remarks.append(f"{zeros:,} points at the origin are left out, as sensors write them for no return")
            points = points[~is_zero]
            weights, normals = (None if each is None else each[~is_zero] for each in (weights, normals))
    offset = _whole_offset(points)
    if offset.any():
        remarks.append(
            f"{', '.join(f'{value:,.0f}' for value in offset)} is taken off its coordinates, which are too large for "
            "single precision"
        )
        if points.dtype == np.float32 and (step := float(np.spacing(np.float32(np.abs(offset).max())))) > _COARSE:
            remarks.append(f"its coordinates are single precision in the file, in steps of {step:g}: digits are lost")
    with np.errstate(over="ignore"):  # what is above float32 is refused as not finite
        near = (points - offset if offset.any() else points).astype(np.float32)
    factor = 1.0 if scale is None else scale
    if scale is not None:
        near = near * np.float32(scale)
    cloud = _checked_cloud(PointCloud(near, weights, normals, source, offset * factor, tuple(remarks)))
    if not len(content.triangles):
        return cloud
    exact = (points - offset) * factor
    on_faces, spacing = sampled(exact, content.triangles)
    if not len(on_faces):
        return cloud
    if spacing > SPACING_M:
        remarks.append(f"points on its faces are {spacing:.3f} m apart, since it is large")
    near = np.concatenate([near, on_faces.astype(np.float32)])
    return PointCloud(near, source=source, offset=cloud.offset, remarks=tuple(remarks))


def _whole_offset(points: NDArray[np.floating]) -> NDArray[np.float64]:
    """Return whole hundreds that bring points near the origin, (3,); zeros along axes on which they are near."""
    finite = points[np.isfinite(points).all(axis=1)]
    if not len(finite):
        return np.zeros(3)
    farthest, middle = np.abs(finite).max(axis=0), np.median(finite, axis=0)
    is_far = (farthest > FAR) & (np.ptp(finite, axis=0) < farthest / 2.0) & (farthest <= _FARTHEST)
    return np.where(is_far, np.rint(middle / 100.0) * 100.0, 0.0).astype(np.float64)


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


def _read_npz(path: Path) -> Content:
    """Read the array ``xyz`` of an NPZ file, or that of an NPY file, whose first columns are x, y and z."""
    arrays = read_arrays(path, f"a whole {'NPY' if path.suffix.lower() == '.npy' else 'NPZ'} file")
    if isinstance(arrays, dict) and _COORDINATES not in arrays:
        raise ValueError(f"{path} holds no array {_COORDINATES}; want points of shape (N, 3)")
    with reading(path, "a cloud"):
        points = arrays[_COORDINATES] if isinstance(arrays, dict) else arrays
        if points.ndim != 2 or points.shape[1] < 3 or (isinstance(arrays, dict) and points.shape[1] != 3):
            raise ValueError(f"its {_COORDINATES} have shape {points.shape}; want (N, 3)")
        points = points[:, :3]
        return Content(points.astype(np.float32 if points.dtype in (np.float16, np.float32) else np.float64))
