"""Files of at most 1 MiB that ask for as much time and memory as they can.

``python -m robustness.heavy [NAME ...]``

Run it in the folder ``tests``. Each is read and used for the first time after valid files of all kinds were;
its CPU time, and its memory beyond what was held, are printed.
"""

import gzip
import importlib.util
import io
import json
import math
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator
from functools import cache, partial
from pathlib import Path

import cv2
import numpy as np
from bag_forms import write_form
from robustness.fuzz import MOST_MB, MOST_S
from robustness.samples import make_samples
from robustness.uses import use
from robustness.worker import outcome_of, read_all

from lidarium.mapping.files.images import MAX_COLOURED, MAX_PIXELS
from lidarium.mapping.files.laser_logs import LaserLog
from lidarium.mapping.grids.scan_geometry import ScanGeometry

MOST_BYTES = 1 << 20
MOST_SIDE, COLOURED_SIDE = math.isqrt(MAX_PIXELS), math.isqrt(MAX_COLOURED)
TRIES = 2
"""How often a file that took too much is read again."""

_draws = np.random.default_rng(0)


def _picture(rows: int, columns: int, suffix: str = ".png", share: float = 0.0, *colours: int) -> bytes:
    """Return a picture of a room with some random cells occupied."""
    pixels = np.full((rows, columns, *colours), 254, np.uint8)
    pixels[[0, -1]] = pixels[:, [0, -1]] = 0
    pixels[_draws.random((rows, columns)) < share] = 0
    return bytes(cv2.imencode(suffix, pixels)[1])


def _repeated(line: str, head: str = "", tail: str = "") -> bytes:
    return (head + line * ((MOST_BYTES - len(head) - len(tail)) // len(line)) + tail).encode()


def _packed(content: bytes) -> bytes:
    return gzip.compress(content, 1)


def _array(cells: np.ndarray) -> bytes:
    file = io.BytesIO()
    np.save(file, cells)
    return file.getvalue()


def _arrays(**arrays: np.ndarray) -> bytes:
    file = io.BytesIO()
    np.savez_compressed(file, **arrays)
    return file.getvalue()


def _outline(corners: int, size: float) -> bytes:
    turns = np.linspace(0.0, 2.0 * np.pi, corners, endpoint=False)
    radii = size * (1.0 + 0.3 * (np.arange(corners) % 2))
    points = np.stack([radii * np.cos(turns), radii * np.sin(turns)], axis=1).round(2)
    return json.dumps({"id": "h", "verts": points.tolist()}).encode()


def _points(count: int, length: float, width: float) -> bytes:
    points = _draws.random((count, 3)) * (length, width, 0.02)
    return "".join(f"{x:.2f} {y:.2f} {z:.2f}\n" for x, y, z in points).encode()


def _mesh(faces: int, size: float) -> bytes:
    corners = _draws.random((1000, 3)) * (size, size, 3.0)
    vertices = "".join(f"v {x:.2f} {y:.2f} {z:.2f}\n" for x, y, z in corners)
    return (vertices + "".join(f"f {i} {j} {k}\n" for i, j, k in _draws.integers(1, 1001, (faces, 3)))).encode()


def _segments(line: str, count: int, size: int) -> bytes:
    ends = _draws.integers(0, size, (count, 4))
    return "".join(line.format(*row) for row in ends).encode()[:MOST_BYTES]


def _plan(walls: int, size: float) -> bytes:
    rows = _draws.uniform(0.5, size - 0.5, (walls, 4)).round(2).tolist()
    return json.dumps(
        {"name": "x", "about": "x", "bounds": [0, 0, size, size], "outer_wall": 0.2, "walls": rows}
    ).encode()[:MOST_BYTES]


def _carmen(beams: int, lines: int) -> bytes:
    scan = f"FLASER {beams} {'3.00 ' * beams}"
    rows = [f"{scan}{k / 10} 0 0 {k / 10} 0 0 {k} h {k}\n" for k in range(lines)]
    return "".join(rows).encode()


def _svg(*elements: str, count: int = 1) -> bytes:
    head = '<svg xmlns="http://www.w3.org/2000/svg" fill="none" stroke="black">'
    each = "".join(elements)
    return _repeated(each, head, "</svg>") if count == 0 else (head + each * count + "</svg>").encode()


def _sdf(models: int, size: float) -> bytes:
    places = _draws.uniform(0.0, size, (models, 2)).round(2)
    shape = "<geometry><cylinder><radius>.3</radius><length>1</length></cylinder></geometry>"
    each = [f"<collision><pose>{x} {y} 0 0 0 0</pose>{shape}</collision>" for x, y in places]
    head, tail = '<sdf version="1.6"><model name="m"><link name="a">', "</link></model></sdf>"
    return (head + "".join(each)[: 140 * models] + tail).encode()


def _grid(side: int, share: float) -> bytes:
    letters = np.where(_draws.random((side, side)) < share, "@", ".")
    lines = "\n".join("".join(row) for row in letters)
    return f"type octile\nheight {side}\nwidth {side}\nmap\n{lines}\n".encode()


def _dxf(entities: str, blocks: str = "") -> bytes:
    """Return a drawing in metres of lines of group codes and values, separated by blanks."""
    header = "0 SECTION 2 HEADER 9 $ACADVER 1 AC1009 9 $INSUNITS 70 6 0 ENDSEC "
    text = f"{header}0 SECTION 2 BLOCKS {blocks}0 ENDSEC 0 SECTION 2 ENTITIES {entities}0 ENDSEC 0 EOF"
    return text.replace(" ", "\n").encode()


def _nested_blocks(deep: int, wide: int, last: str) -> str:
    """Return blocks of which each holds the next one several times."""
    each = "0 BLOCK 8 0 2 B{0} 70 0 10 0 20 0 {1}0 ENDBLK 8 0 "
    inserts = [f"0 INSERT 8 0 2 B{k + 1} 10 1 20 1 " * wide for k in range(deep)]
    return "".join(each.format(k, held) for k, held in enumerate([*inserts, last]))


@cache
def _written(scans: int, beams: int) -> bytes:
    from lidarium.mapping.files.bags.writing import write_mcap_log

    stamps, poses = 0.1 * np.arange(scans), np.zeros((scans, 3))
    log = LaserLog(
        stamps=stamps,
        ranges=np.full((scans, beams), 3.0, np.float32),
        geometry=ScanGeometry(beams=beams, field_of_view=3.0, range_max=8.0),
        odometry=poses,
        readings_stamps=stamps,
        readings=poses,
        reading_of_scan=np.arange(scans),
    )
    with tempfile.TemporaryDirectory() as folder:
        write_mcap_log(Path(folder, "bag.mcap"), log)
        return Path(folder, "bag.mcap").read_bytes()


def _bag(scans: int, beams: int, name: str = "bag.mcap") -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "bag.mcap").write_bytes(_written(scans, beams))
        if name != "bag.mcap":
            write_form(Path(folder, name), Path(folder, "bag.mcap"))
        return Path(folder, name).read_bytes()


_LINE = "0 LINE 8 0 10 {} 20 {} 11 {} 21 {} "
_ARC = "0 ARC 8 0 10 0 20 0 40 1 50 0 51 1 "
_ELLIPSE = "0 ELLIPSE 8 0 10 0 20 0 11 1 21 0 40 1 41 0 42 .1 "
_LIGHT = "0 LWPOLYLINE 100 AcDbPolyline 90 2 10 0 20 0 10 1 20 1 "
_HEAVY, _VERTICES = "0 POLYLINE 66 1 ", "0 VERTEX 8 0 10 0 20 0 0 VERTEX 8 0 10 0 20 4 "
_ROOM = "".join(map(_LINE.format, (0, 9, 9, 0), (0, 0, 9, 9), (9, 9, 0, 0), (0, 9, 9, 0)))

CASES: dict[str, tuple[str, Callable[[], bytes]]] = {
    "a large room": ("image.png", lambda: _picture(MOST_SIDE, MOST_SIDE)),
    "a large room in colour": ("image.png", lambda: _picture(COLOURED_SIDE, COLOURED_SIDE, ".png", 0.0, 4)),
    "a room of 2,000 x 2,000": ("image.png", lambda: _picture(2000, 2000)),
    "noise, 2,000 x 2,000": ("image.png", lambda: _picture(2000, 2000, share=0.05)),
    "noise, 700 x 700": ("image.pgm", lambda: _picture(700, 700, ".pgm", 0.5)),
    "noise, 1,000 x 1,000": ("image.pgm", lambda: _picture(1000, 1000, ".pgm", 0.3)),
    "a large dungeon": ("dungeon.png", lambda: _picture(MOST_SIDE, MOST_SIDE)),
    "noisy array": ("array.npy", lambda: _array((_draws.random((1000, 1000)) < 0.3).astype(np.uint8))),
    "long array": ("array.npz", lambda: _arrays(solid=np.zeros((4000, 4000), bool), origin=np.zeros(2))),
    "outline of many corners": ("houseexpo.json", lambda: _outline(60_000, 40.0)),
    "outline of far corners": ("houseexpo.json", lambda: _outline(300, 900.0)),
    "packed outline": ("houseexpo.json.gz", lambda: _packed(_outline(150_000, 40.0))),
    "many lines": ("amrl.vectormap.txt", lambda: _segments("{}, {}, {}, {}\n", 60_000, 200)),
    "few long lines": ("amrl.vectormap.txt", lambda: _segments("{}, {}, {}, {}\n", 500, 900)),
    "many walls": ("lifull.txt", lambda: _segments("{} {} {} {} wall\n", 40_000, 2000)),
    "few long walls": ("lifull.txt", lambda: _segments("{} {} {} {} wall\n", 500, 9000)),
    "drawn walls": ("drawn.json", lambda: _plan(30_000, 100.0)),
    "long drawn walls": ("drawn.json", lambda: _plan(200, 900.0)),
    "log of many scans": ("carmen.log.gz", lambda: _packed(_carmen(8, 60_000))),
    "log of many beams": ("carmen.log.gz", lambda: _packed(_carmen(16_000, 20))),
    "many readings": ("carmen.log.gz", lambda: _packed(_repeated("ODOM 0 0 0 0 0 0 1 h 1\n") * 4)),
    "trajectory": ("trajectory.tum", lambda: _repeated("0 0 0 0 0 0 0 1\n")),
    "relations": ("relations.txt", lambda: _repeated("0 1 0 0 0 0 0 0\n")),
    "many episodes": ("episodes.jsonl", lambda: _repeated('{"key":"a"}\n')),
    "numbers of a suite": ("suite.toml", lambda: _repeated("1,", "robots = [", "1]\n")),
    "tables of a suite": ("suite.toml", lambda: "".join(f"[a{k}]\n" for k in range(100_000)).encode()),
    "nested file": ("drawn.json", lambda: _repeated('{"a":', "", "")),
    "many lines of a drawing": ("svg.svg", lambda: _svg('<path d="M1 1L9 9"/>', count=0)),
    "a long path": ("svg.svg", lambda: _svg('<path d="M0 0', "L9 1L1 9" * 120_000, '"/>')),
    "curves of a long path": ("svg.svg", lambda: _svg('<path d="M0 0', "t1 1" * 240_000, '"/>')),
    "long lines of a drawing": ("svg.svg", lambda: _svg('<path d="M0 0H9000V9000H0Z"/>', count=200)),
    "curves of a drawing": (
        "svg.svg",
        lambda: _svg('<circle r="900"/><path d="M0 0a9 9 1 0 1 9 9"/>', count=0),
    ),
    "many solids of a world": ("sdf.world", lambda: _sdf(7000, 50.0)),
    "far solids of a world": ("sdf.world", lambda: _sdf(50, 4000.0)),
    "a grid map": ("movingai.map", lambda: _grid(1000, 0.3)),
    "lines of a DXF": (
        "dxf.dxf",
        lambda: _dxf(_segments(_LINE, 20_000, 9).decode()[:900_000].rsplit("0 LINE", 1)[0] + _ROOM),
    ),
    "long lines of a DXF": ("dxf.dxf", lambda: _dxf(_segments(_LINE, 500, 900).decode() + _ROOM)),
    "nested blocks": (
        "dxf.dxf",
        lambda: _dxf("0 INSERT 8 0 2 B0 10 0 20 0 " + _ROOM, _nested_blocks(9, 9, _ROOM)),
    ),
    "nested empty blocks": (
        "dxf.dxf",
        lambda: _dxf("0 INSERT 8 0 2 B0 10 0 20 0 " + _ROOM, _nested_blocks(9, 9, "")),
    ),
    "a block within itself": (
        "dxf.dxf",
        lambda: _dxf(
            "0 INSERT 8 0 2 B0 10 0 20 0 " + _ROOM,
            "0 BLOCK 8 0 2 B0 70 0 10 0 20 0 0 INSERT 8 0 2 B0 10 1 20 1 0 ENDBLK 8 0 ",
        ),
    ),
    "rows of a block": (
        "dxf.dxf",
        lambda: _dxf("0 INSERT 8 0 2 B0 10 0 20 0 70 30000 71 30000 44 1 45 1 " + _ROOM, _nested_blocks(0, 0, _ROOM)),
    ),
    "light polylines of a DXF": ("dxf.dxf", lambda: _dxf(_LIGHT * 18_000 + _ROOM)),
    "heavy polylines of a DXF": ("dxf.dxf", lambda: _dxf(_HEAVY + _VERTICES * 12_000 + "0 SEQEND " + _ROOM)),
    "arcs of a DXF": ("dxf.dxf", lambda: _dxf(_ARC * 4_700 + "0 TEXT 8 0 1 a " * 50_000 + _ROOM)),
    "many arcs of a DXF": ("dxf.dxf", lambda: _dxf(_ARC * 28_000 + _ROOM)),
    "ellipses of a DXF": ("dxf.dxf", lambda: _dxf(_ELLIPSE * 4_000 + _ROOM)),
    "points of a DXF": ("dxf.dxf", lambda: _dxf("0 POINT 8 0 10 0 20 0 " * 45_000 + _ROOM)),
    "places of a block": (
        "dxf.dxf",
        lambda: _dxf("0 INSERT 8 0 2 B0 10 0 20 0 " * 3_900, _nested_blocks(0, 0, _ROOM)),
    ),
    "a damaged DXF": (
        "dxf.dxf",
        lambda: _dxf(_ARC * 3_900 + _LINE.format(0, 0, 9, 9) * 24_000 + _ROOM).replace(b"0\nENDSEC\n0\nEOF", b"0\nEOF"),
    ),
    "a large circle": ("dxf.dxf", lambda: _dxf("0 CIRCLE 8 0 10 0 20 0 40 1e12 " + _ROOM)),
    "curves of a DXF": ("dxf.dxf", lambda: _dxf("0 CIRCLE 8 0 10 5 20 5 40 900 " * 20_000 + _ROOM)),
    "a bag of many scans": ("bag.mcap", lambda: _bag(13_000, 8)),
    "a bag of many beams": ("bag.mcap", lambda: _bag(2000, 8000)),
    "a bag of ROS 1": ("bag_bz2.bag", lambda: _bag(13_000, 8, "bag_bz2.bag")),
    "a packed bag": ("bag.db3.zstd", lambda: _bag(13_000, 8, "bag.db3.zstd")),
    "a bag in sqlite": ("bag.db3", lambda: _bag(500, 8, "bag.db3")),
    "a cloud": ("cloud_lines.xyz", lambda: _points(40_000, 9.0, 9.0)),
    "a wide cloud": ("cloud_lines.xyz", lambda: _points(40_000, 900.0, 900.0)),
    "a long thin cloud": ("cloud_lines.xyz", lambda: _points(190, 770.0, 3.0)),
    "a far cloud": ("cloud_lines.xyz", lambda: _points(10, 1e6, 1e6)),
    "a cloud of one place": ("cloud_lines.xyz", lambda: _repeated("1 1 0\n")),
    "a mesh": ("cloud_mesh.obj", lambda: _repeated("f 1 2 3\n", "v 0 0 0\nv 9 0 0\nv 0 9 0\nv 0 0 9\n", "f 1 2 4\n")),
    "a wide mesh": ("cloud_mesh.obj", lambda: _mesh(30_000, 900.0)),
    "a pose": ("pose.txt", lambda: _repeated("0 0 1 0.5\n")),
    "boxes of a sparse map": ("sparse_text.txt", lambda: _repeated("box 0 0 0 1 1 1\n")),
    "curves": ("splines.json", lambda: _repeated('{"knots":[0,1],"points":[[0,0]]},', '{"curves":[', "{}]}")),
}
"""By name: what the file is called, and how it is made."""

_NEEDS = {".dxf": "ezdxf", ".mcap": "rosbags", ".bag": "rosbags", ".db3": "rosbags", ".zstd": "rosbags"}
"""Modules without which files are not read."""


def measured(names: Iterable[str] = tuple(CASES), most_s: float = MOST_S) -> Iterator[tuple[str, dict[str, object]]]:
    """Yield of each file how it ended, its CPU time [s] and memory [MB]; one that takes more is read again."""
    with tempfile.TemporaryDirectory() as folder:
        samples, place = Path(folder, "samples"), Path(folder, "files")
        make_samples(samples)
        place.mkdir()
        read_all(sorted(path for path in samples.iterdir() if path.is_file()), place)
        for name in names:
            called, make = CASES[name]
            if importlib.util.find_spec(_NEEDS.get(Path(called).suffix, "lidarium")) is None:
                continue
            path, content = place / called, make()
            if len(content) > MOST_BYTES:
                raise ValueError(f"{name} has {len(content):,} bytes; want at most {MOST_BYTES:,}")
            path.write_bytes(content)
            found = outcome_of(partial(use, path))
            for _ in range(TRIES):  # kernels may have been compiled for it, or the machine was busy
                if is_costly(found, most_s):
                    found = outcome_of(partial(use, path))
            yield name, found


def main(names: list[str]) -> int:
    """Measure files and print what each took; the exit code is 1 where one took too much."""
    above = count = 0
    for name, found in measured(names or CASES):
        count += 1
        above += is_costly(found)
        print(f"{name}: {json.dumps(found)[:200]}", flush=True)
    print(f"{above} of {count} above {MOST_S:g} s or {MOST_MB:g} MB")
    return int(above > 0)


def is_costly(found: dict[str, object], most_s: float = MOST_S) -> bool:
    """Whether a file took more than one may."""
    return float(str(found["cpu_s"])) > most_s or float(str(found["mb"])) > MOST_MB


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
