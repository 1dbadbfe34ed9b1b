"""PCD files of the Point Cloud Library: text, binary, compressed.

Points whose coordinates are nan are no measurements there, and left out. The viewpoint is not applied.
"""

import struct
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.files.guarded_reading import MOST_FILE_BYTES
from lidarium.mapping.files.output import write_whole
from lidarium.mapping.point_clouds.columns import cloud_of_columns, text_columns, wanted_columns
from lidarium.mapping.point_clouds.lzf import unpacked
from lidarium.mapping.point_clouds.point_cloud import PointCloud

MOST_HEADER = 65536
"""Most bytes of a header."""

_KINDS = {"F": "f", "I": "i", "U": "u"}
_SIZES = {"f": (4, 8), "i": (1, 2, 4, 8), "u": (1, 2, 4, 8)}
_FORMS = ("ascii", "binary", "binary_compressed")


@dataclass(frozen=True, slots=True)
class _Header:
    """What a header says: names, kinds and counts of fields, points, form, and where the points begin."""

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


def parse_pcd(content: bytes, source: str) -> PointCloud:
    """Return the cloud of a PCD file's bytes.

    Raises
    ------
    ValueError
        Where it is none, truncated, or claims more than it holds.
    """
    header = _header_of(content)
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
    cloud = cloud_of_columns(columns, source)
    return cloud.chosen(~np.isnan(cloud.points).any(axis=1))


def _checked_size(body: bytes, header: _Header) -> bytes:
    """Return the bytes of the points; what follows them is left out."""
    size = header.points * header.row.itemsize
    if size > len(body):
        raise ValueError(
            f"it claims {header.points:,} points of {header.row.itemsize} bytes and holds {len(body):,} "
            "bytes of points: truncated"
        )
    return body[:size]


def _unpacked_columns(
    body: bytes, header: _Header, wanted: list[str], places: list[int]
) -> dict[str, NDArray[np.generic]]:
    """Return columns of a compressed file: numbers of a field lie side by side."""
    if len(body) < 8:
        raise ValueError("it ends before its packed points: truncated")
    packed, size = struct.unpack("<II", body[:8])
    if packed > len(body) - 8:
        raise ValueError(f"it claims {packed:,} packed bytes and holds {len(body) - 8:,}: truncated")
    row = header.row
    if size != header.points * row.itemsize:
        raise ValueError(
            f"it claims {header.points:,} points of {row.itemsize} bytes, but packs {size:,} bytes"
        )
    whole, columns, start = unpacked(body[8 : 8 + packed], size), {}, 0
    for place, (kind, count) in enumerate(zip(header.kinds, header.counts, strict=True)):
        length = header.points * count * int(kind[1])
        if place in places:
            name = wanted[places.index(place)]
            columns[name] = np.frombuffer(whole[start : start + length].tobytes(), f"<{kind}")
        start += length
    return columns


def _header_of(content: bytes) -> _Header:
    """Return what the header says."""
    said: dict[str, list[str]] = {}
    start = 0
    while "DATA" not in said:
        end = content.find(b"\n", start, MOST_HEADER)
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
    kinds = tuple(f"{_KINDS.get(kind, kind)}{size}" for kind, size in zip(said["TYPE"], sizes, strict=True))
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
    if min(counts) < 1 or points * sum(counts) > MOST_FILE_BYTES:
        raise ValueError(f"it claims {points:,} points of {sum(counts):,} numbers; want fewer")
    return _Header(names, kinds, counts, points, form, start)


def _numbers(words: list[str]) -> tuple[int, ...]:
    """Return whole numbers that are not below 0."""
    numbers = tuple(int(word) for word in words)
    if not numbers or min(numbers) < 0:
        raise ValueError(f"its header has {' '.join(words) or 'nothing'} for numbers")
    return numbers


def write_pcd(path: Path | str, cloud: PointCloud) -> None:
    """Write a cloud as a binary PCD file, with its normals and weights.

    Raises
    ------
    OSError
        Where nothing can be written there.
    """
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
