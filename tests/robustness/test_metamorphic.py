"""What a file says does not depend on the legal form in which it is written.

Each file here is written in other forms that its format allows; all have to be read as the first one is.
"""

import gzip
import importlib.util
import json
import math
from dataclasses import replace

import cv2
import numpy as np
import pytest

from lidarium.envs.floors.catalogue.names import describe_floor
from lidarium.envs.floors.importers import load_file
from lidarium.mapping.files.log_files import read_log
from lidarium.mapping.files.map_files import read_grey_map, read_ros_map
from lidarium.mapping.files.npz_logs import write_npz_log
from lidarium.mapping.files.trajectories import read_tum, write_tum

BEAMS, SCANS = 31, 6


def encodings(text):
    """Yield a name and the bytes of each way in which a text can be stored."""
    yield "as it is", text.encode()
    yield "CRLF", text.replace("\n", "\r\n").encode()
    yield "byte order mark", text.encode("utf-8-sig")
    yield "UTF-16 LE", b"\xff\xfe" + text.encode("utf-16-le")
    yield "UTF-16 BE", b"\xfe\xff" + text.replace("\n", "\r\n").encode("utf-16-be")
    yield "no newline at its end", text.rstrip("\n").encode()
    yield "empty lines at its end", (text + "\n\n").encode()


# Logs


def carmen(kind="FLASER", form="{:.4f}", between=" ", order=1):
    """Return a log of CARMEN; odometry comes before its scan or behind it."""
    lines = ["PARAM laser_front_laser_resolution 1", f"PARAM laser_front_laser_fov {BEAMS - 1}"]
    step = math.radians(1.0)
    for k in range(SCANS):
        x, y, theta, stamp = 0.1 * k, 0.02 * k, 0.03 * k, f"{0.5 * k:.3f}"
        pose = [form.format(each) for each in (x, y, theta)]
        ranges = [form.format(81.0 if i == 9 else 2.0 + 0.1 * k + 0.05 * i) for i in range(BEAMS)]
        scan = ["FLASER", str(BEAMS), *ranges, *pose, *pose, stamp, "host", stamp]
        if kind == "ROBOTLASER1":
            head = ["0", f"{-15 * step:.9f}", f"{30 * step:.9f}", f"{step:.9f}", "80", "0.01", "0", str(BEAMS)]
            scan = [kind, *head, *ranges, "0", *pose, *pose, "0 0 0 0 0", stamp, "host", stamp]
        if kind == "LASER_READING":
            scan = [kind, str(BEAMS), *ranges, *pose, stamp]
        odometry = ["ODOM", *pose, "0", "0", "0", stamp, "host", stamp]
        lines += [between.join(words) for words in (odometry, scan)[::order]]
    return "\n".join(lines) + "\n"


def carmen_forms():
    text = carmen()
    for name, content in encodings(text):
        yield name, "a.log", content
    yield "tabs", "a.log", carmen(between="\t").encode()
    yield "blanks", "a.log", ("  " + carmen(between="   ").replace("\n", " \n ")).encode()
    yield "exponents", "a.clf", carmen(form="{:+.6e}").encode()
    yield "odometry behind", "a.log", carmen(order=-1).encode()
    yield "remarks", "a.log", ("# of a robot\n\n" + text.replace("FLASER", "# again\n\nFLASER")).encode()
    yield "packed", "a.log.gz", gzip.compress(text.encode())
    yield "packed in parts", "a.clf.gz", gzip.compress(text[:99].encode()) + gzip.compress(text[99:].encode())
    yield "directions told", "a.log", carmen("ROBOTLASER1").encode()
    yield "as of GMapping", "a.log", carmen("LASER_READING").encode()


def assert_same_log(found, expected, tolerance=1e-6):
    assert not found.skipped, found.skipped
    np.testing.assert_allclose(found.stamps - found.stamps[0], expected.stamps - expected.stamps[0], atol=tolerance)
    np.testing.assert_allclose(found.ranges, expected.ranges, atol=tolerance)
    np.testing.assert_allclose(found.odometry, expected.odometry, atol=tolerance)
    np.testing.assert_allclose(found.laser_pose, expected.laser_pose, atol=tolerance)
    np.testing.assert_allclose(found.geometry.angles, expected.geometry.angles, atol=tolerance)


@pytest.mark.parametrize(("name", "file", "content"), list(carmen_forms()), ids=[each[0] for each in carmen_forms()])
def test_a_carmen_log_is_the_same_in_every_form(name, file, content, tmp_path):
    (tmp_path / "plain.log").write_text(carmen())
    (tmp_path / file).write_bytes(content)
    expected = read_log(tmp_path / "plain.log")
    assert expected.geometry.field_of_view == pytest.approx(math.radians(30.0))
    assert len(expected.stamps) == SCANS
    assert_same_log(read_log(tmp_path / file), expected)


def drawn_log(tmp_path):
    (tmp_path / "plain.log").write_text(carmen())
    log = read_log(tmp_path / "plain.log")
    return replace(log, geometry=replace(log.geometry, range_max=20.0), laser_pose=np.array([0.25, 0.0, 0.0]))


ARRAYS = {
    "not packed": lambda arrays, path: np.savez(path, **arrays),
    "double precision": lambda arrays, path: np.savez(
        path, **{k: v.astype(np.float64) if v.dtype == np.float32 else v for k, v in arrays.items()}
    ),
    "other order of bytes": lambda arrays, path: np.savez(
        path, **{k: v.astype(v.dtype.newbyteorder(">")) for k, v in arrays.items()}
    ),
    "columns first": lambda arrays, path: np.savez(path, **{k: v.copy("F") for k, v in arrays.items()}),
    "other order of arrays": lambda arrays, path: np.savez(path, **dict(reversed(arrays.items()))),
    "more arrays": lambda arrays, path: np.savez(path, notes=np.arange(3), **arrays),
}


@pytest.mark.parametrize("form", ARRAYS)
def test_arrays_of_a_log_are_the_same_in_every_form(form, tmp_path):
    log = drawn_log(tmp_path)
    write_npz_log(tmp_path / "log.npz", log)
    with np.load(tmp_path / "log.npz") as archive:
        ARRAYS[form](dict(archive), tmp_path / "other.npz")
    assert_same_log(read_log(tmp_path / "log.npz"), log)
    assert_same_log(read_log(tmp_path / "other.npz"), log)


@pytest.mark.skipif(importlib.util.find_spec("rosbags") is None, reason="needs the extra bags")
@pytest.mark.parametrize("name", ["a.mcap", "a.db3", "a.db3.zstd", "a.bag", "lz4.bag", "bz2.bag", "MCAP", "SQLITE3"])
def test_a_bag_holds_what_arrays_and_lines_hold(name, tmp_path):
    from bag_forms import write_folder, write_form

    from lidarium.mapping.files.bags.writing import write_mcap_log

    log = drawn_log(tmp_path)
    write_mcap_log(tmp_path / "a.mcap", log)
    if name in ("MCAP", "SQLITE3"):
        write_folder(tmp_path / name, tmp_path / "a.mcap", name)
    elif name != "a.mcap":
        write_form(tmp_path / name, tmp_path / "a.mcap")
    found = read_log(tmp_path / name)
    assert_same_log(found, log)
    assert found.geometry.range_max == log.geometry.range_max


def test_lines_of_mines_may_end_and_be_packed_otherwise(tmp_path):
    rows = [f"{200_000 * k} 0 {100 * k} {110 * k} {'0 ' * 20}{' '.join(['1500'] * 682)} 5" for k in range(4)]
    text = "\n".join(rows) + "\n"
    (tmp_path / "plain.dat").write_text(text)
    expected = read_log(tmp_path / "plain.dat")
    for name, content in encodings(text):
        (tmp_path / "a.dat").write_bytes(content)
        (tmp_path / "a.dat.gz").write_bytes(gzip.compress(content))
        for file in ("a.dat", "a.dat.gz"):
            found = read_log(tmp_path / file)
            assert not found.skipped, name
            np.testing.assert_array_equal(found.ranges, expected.ranges, err_msg=name)
            np.testing.assert_array_equal(found.odometry, expected.odometry, err_msg=name)


def test_a_trajectory_is_the_same_in_every_form(tmp_path):
    stamps, poses = np.arange(5.0) + 0.5, np.stack([np.arange(5.0), np.ones(5), np.linspace(-3.0, 3.0, 5)], axis=1)
    write_tum(tmp_path / "plain.tum", stamps, poses)
    text = (tmp_path / "plain.tum").read_text()
    rows = [line.split() for line in text.splitlines()]
    forms = dict(encodings(text))
    forms["remarks"] = ("# stamp x y z qx qy qz qw\n" + text).encode()
    forms["other order"] = "\n".join(reversed(text.splitlines())).encode()
    forms["tabs"] = text.replace(" ", "\t").encode()
    # A quaternion and its negative are one rotation.
    turned = [row[:4] + [f"{-float(word)}" for word in row[4:]] for row in rows]
    forms["other sign"] = "\n".join(map(" ".join, turned)).encode()
    for name, content in forms.items():
        (tmp_path / "a.tum").write_bytes(content)
        (tmp_path / "a.tum.gz").write_bytes(gzip.compress(content))
        for file in ("a.tum", "a.tum.gz"):
            found = read_tum(tmp_path / file)
            np.testing.assert_array_equal(found[0], stamps, err_msg=name)
            np.testing.assert_allclose(found[1], poses, atol=1e-6, err_msg=name)


# Maps

GREYS = {0: 0, 205: 127, 254: 255}
HEADER = {
    "image": "map.pgm",
    "resolution": 0.05,
    "origin": [1.5, -2.0, 0.5],
    "negate": 0,
    "occupied_thresh": 0.65,
    "free_thresh": 0.196,
}


def room():
    """Return a room with a wall and an unknown corner, as map_saver writes its pixels."""
    pixels = np.full((40, 60), 254, np.uint8)
    pixels[[0, -1]] = pixels[:, [0, -1]] = 0
    pixels[20, :40] = 0
    pixels[25:30, 50:55] = 205
    return pixels


def netpbm(magic, pixels, maximum, separator="\n"):
    rows, columns = pixels.shape[:2]
    head = separator.join((magic, f"{columns} {rows}", str(maximum))) + "\n"
    if magic in ("P2", "P3"):
        return (head + "\n".join(" ".join(map(str, row.ravel())) for row in pixels) + "\n").encode()
    return head.encode() + pixels.astype(np.uint8 if maximum < 256 else ">u2").tobytes()


def encoded(suffix, pixels, *options):
    return cv2.imencode(suffix, pixels, options)[1].tobytes()


def palette_png(pixels):
    """Return a PNG whose pixels are numbers of colours."""
    import struct
    import zlib

    colours = sorted(GREYS)
    rows = b"".join(b"\0" + bytes(colours.index(value) for value in row) for row in pixels.tolist())
    chunks = [
        (b"IHDR", struct.pack(">IIBBBBB", pixels.shape[1], pixels.shape[0], 8, 3, 0, 0, 0)),
        (b"PLTE", bytes(each for value in colours for each in (value,) * 3)),
        (b"IDAT", zlib.compress(rows)),
        (b"IEND", b""),
    ]
    body = b"".join(
        struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))
        for kind, content in chunks
    )
    return b"\x89PNG\r\n\x1a\n" + body


def pictures():
    """Return pictures of the room by their names."""
    pixels = room()
    colours = cv2.cvtColor(pixels, cv2.COLOR_GRAY2BGR)
    opaque = np.concatenate([colours, np.full((40, 60, 1), 255, np.uint8)], axis=-1)
    ascii_pgm = netpbm("P2", pixels, 255)
    return {
        "binary.pgm": netpbm("P5", pixels, 255),
        "one_line_header.pgm": netpbm("P5", pixels, 255, " "),
        "remark.pgm": netpbm("P5", pixels, 255).replace(b"P5\n", b"P5\n# CREATOR: map_saver.cpp 0.050 m/pix\n"),
        "remark_behind.pgm": netpbm("P5", pixels, 255).replace(b"60 40\n", b"60 40 # columns, rows\n"),
        "lines.pgm": ascii_pgm,
        "windows_lines.pgm": ascii_pgm.replace(b"\n", b"\r\n"),
        "wrapped.pgm": b"P2\n60 40\n255\n" + ascii_pgm.split(b"255\n", 1)[1].replace(b" ", b"\n"),
        "remark_lines.pgm": ascii_pgm.replace(b"P2\n", b"P2\n# by hand\n"),
        "sixteen_bits.pgm": netpbm("P5", pixels.astype(np.uint16) * 257, 65535),
        "sixteen_bits_lines.pgm": netpbm("P2", pixels.astype(np.uint16) * 257, 65535),
        "up_to_510.pgm": netpbm("P5", pixels.astype(np.uint16) * 2, 510),
        "colours.ppm": netpbm("P6", colours, 255),
        "colour_lines.ppm": netpbm("P3", colours, 255),
        "upper_case.PGM": netpbm("P5", pixels, 255),
        "grey.png": encoded(".png", pixels),
        "colours.png": encoded(".png", colours),
        "opaque.png": encoded(".png", opaque),
        "sixteen_bits.png": encoded(".png", pixels.astype(np.uint16) * 257),
        "palette.png": palette_png(pixels),
        "grey.bmp": encoded(".bmp", pixels),
        "colours.bmp": encoded(".bmp", colours),
        "grey.tif": encoded(".tif", pixels),
        "not_packed.tif": encoded(".tif", pixels, cv2.IMWRITE_TIFF_COMPRESSION, 1),
        "colours.tif": encoded(".tif", colours),
        "sixteen_bits.tif": encoded(".tif", pixels.astype(np.uint16) * 257),
    }


def header(**changes):
    return "".join(f"{key}: {value}\n" for key, value in {**HEADER, **changes}.items())


def levels_of_room():
    return np.vectorize(GREYS.get)(room())[::-1]


@pytest.mark.parametrize("name", pictures())
def test_the_picture_of_a_map_is_the_same_in_every_form(name, tmp_path):
    (tmp_path / name).write_bytes(pictures()[name])
    (tmp_path / "map.yaml").write_text(header(image=name))
    np.testing.assert_array_equal(read_ros_map(tmp_path / "map.yaml").levels, levels_of_room())
    np.testing.assert_array_equal(read_grey_map(tmp_path / name, 0.05).levels, levels_of_room())
    if not name.endswith("ppm"):  # which is no format of floors
        assert describe_floor(load_file(tmp_path / name, 0.05))["area_m2"] == pytest.approx(5.35, abs=0.01)


HEADERS = {
    **dict(encodings(header())),
    "JSON": json.dumps(HEADER).encode(),
    "one line": ("{" + header().strip().replace("\n", ", ") + "}").encode(),
    "list in lines": header(origin="\n  - 1.5\n  - -2.0\n  - 0.5").encode(),
    "quotes": header(image='"map.pgm"', resolution="'0.05'").encode(),
    "marks and remarks": ("--- # of a robot\n" + header(negate="0 # no") + "...\n").encode(),
    "other order": "".join(reversed(header().splitlines(keepends=True))).encode(),
    "false": header(negate="false").encode(),
    "exponents": header(resolution="5e-2", origin="[15e-1, -2e0, 5.0e-1]").encode(),
    "mode": header(mode="trinary").encode(),
    "scale": header(mode="scale").encode(),
    "more keys": header(cost_translation_table="", robot="a").encode(),
    "blanks": header().replace(": ", ":    ").encode(),
    "whole turn": header(origin=[1.5, -2.0, 0.5 + 2.0 * math.pi]).encode(),
    "folder": header(image="./map.pgm").encode(),
}


@pytest.mark.parametrize("name", HEADERS)
def test_the_header_of_a_map_is_the_same_in_every_form(name, tmp_path):
    (tmp_path / "map.pgm").write_bytes(netpbm("P5", room(), 255))
    (tmp_path / "map.yaml").write_bytes(HEADERS[name])
    found = read_ros_map(tmp_path / "map.yaml")
    np.testing.assert_array_equal(found.levels, levels_of_room())
    assert found.resolution == 0.05
    assert found.origin[:2] == (1.5, -2.0)
    assert math.remainder(found.origin[2] - 0.5, 2.0 * math.pi) == pytest.approx(0.0, abs=1e-9)
    floor = load_file(tmp_path / "map.yaml")
    assert floor.bounds == pytest.approx(load_plain(tmp_path).bounds)


def load_plain(tmp_path):
    (tmp_path / "plain.yaml").write_text(header())
    return load_file(tmp_path / "plain.yaml")


@pytest.mark.parametrize("bits", [8, 16])
def test_a_negative_of_a_map_is_the_same_map(bits, tmp_path):
    most = 255 if bits == 8 else 65535
    pixels = most - room().astype(np.uint32) * (1 if bits == 8 else 257)
    (tmp_path / "map.pgm").write_bytes(netpbm("P5", pixels, most))
    (tmp_path / "map.yaml").write_text(header(negate=1))
    np.testing.assert_array_equal(read_ros_map(tmp_path / "map.yaml").levels, levels_of_room())


# Drawings


def area_and_size(path, resolution=None):
    floor = load_file(path, resolution)
    return describe_floor(floor)["area_m2"], *np.round(np.subtract(floor.bounds[2:], floor.bounds[:2]), 2).tolist()


def svg(body, head='viewBox="0 0 600 400"'):
    return f'<svg xmlns="http://www.w3.org/2000/svg" {head}>{body}</svg>'


WALLS = "fill='none' stroke='black' stroke-width='10'"
PLAIN_SVG = svg(f"<path d='M 0 0 H 600 V 400 H 0 Z M 300 0 V 250' {WALLS}/>")
SVGS = {
    **dict(encodings(PLAIN_SVG + "\n")),
    "declared UTF-16": ('<?xml version="1.0" encoding="UTF-16"?>' + PLAIN_SVG).encode("utf-16"),
    "declared Latin-1": ('<?xml version="1.0" encoding="ISO-8859-1"?><!-- Tür -->' + PLAIN_SVG).encode("latin-1"),
    "doctype": '<!DOCTYPE svg PUBLIC "-//W3C//DTD SVG 1.1//EN" "svg11.dtd">' + PLAIN_SVG,
    "prefix": PLAIN_SVG.replace("xmlns=", "xmlns:s=")
    .replace("<svg", "<s:svg")
    .replace("/svg", "/s:svg")
    .replace("<path", "<s:path"),
    "relative path": svg(f"<path d='m0,0h600v400h-600zm300,0v250' {WALLS}/>"),
    "numbers without blanks": svg(f"<path d='M0 0L600 0 6e2 400L0 400.0L0-0ZM300-0L300 +250' {WALLS}/>"),
    "polygon and line": svg(
        f"<g {WALLS}><polygon points='0,0 600,0 600,400 0,400'/><line x1='300' x2='300' y2='250'/></g>"
    ),
    "polyline": svg(
        f"<polyline points='0 0 600 0 600 400 0 400 0 0' {WALLS}/><polyline points='300,0,300,250' {WALLS}/>"
    ),
    "rectangle": svg(f"<rect width='600' height='400' {WALLS}/><path d='M300 0V250' {WALLS}/>"),
    "areas": svg(
        "<path fill-rule='evenodd' d='M-5-5H605V405H-5ZM5 5V395H595V5Z'/><rect x='295' width='10' height='250'/>"
    ),
    "style": svg("<path d='M0 0H600V400H0ZM300 0V250' style='fill:none;stroke:#000;stroke-width:10px'/>"),
    "style sheet": svg(
        "<style>path {fill: none; stroke: rgb(0,0,0); stroke-width: 10}</style><path d='M0 0H600V400H0ZM300 0V250'/>"
    ),
    "transform": svg(
        "<g transform='translate(300 200) scale(2)'>"
        f"<path d='M-150-100h300v200h-300zM0-100v125' {WALLS.replace('10', '5')}/></g>"
    ),
    "matrix": svg(f"<path transform='matrix(0 -1 1 0 0 400)' d='M0 0H400V600H0ZM400 300H150' {WALLS}/>"),
    "used": svg(f"<defs><path id='a' d='M0 0H600V400H0ZM300 0V250' {WALLS}/></defs><use href='#a'/>"),
    "inner drawing": svg(f"<svg x='100' y='50'><path d='M-100-50H500V350H-100ZM200-50V200' {WALLS}/></svg>"),
    "inner scale": svg(
        "<svg width='600' height='400' viewBox='0 0 60 40'>"
        f"<path d='M0 0H60V40H0ZM30 0V25' {WALLS.replace('10', '1')}/></svg>"
    ),
    "millimetres": svg(
        "<path d='M0 0H600V400H0Z' " + WALLS + "/><line x1='79.375mm' x2='79.375mm' y2='66.1458mm' " + WALLS + "/>"
    ),
    "inches": svg(
        f"<rect width='6.25in' height='300pt' {WALLS}/><path d='M300 0V250' {WALLS.replace('10', '7.5pt')}/>"
    ),
    "shares": svg(f"<rect width='100%' height='100%' {WALLS}/><line x1='50%' x2='50%' y2='62.5%' {WALLS}/>"),
    "paper": svg(f"<path d='M0 0H600V400H0ZM300 0V250' {WALLS}/>", 'width="60mm" height="40mm" viewBox="0 0 600 400"'),
    "white paper of unknown size": svg(
        f"<rect width='100%' height='100%' fill='#fff'/><path d='M0 0H600V400H0ZM300 0V250' {WALLS}/>", ""
    ),
    "white paper": svg(
        "<rect width='100%' height='100%' fill='white'/>" + f"<path d='M0 0H600V400H0ZM300 0V250' {WALLS}/>"
    ),
}


@pytest.mark.parametrize("name", SVGS)
def test_a_drawing_of_svg_is_the_same_in_every_form(name, tmp_path):
    content = SVGS[name]
    (tmp_path / "a.svg").write_bytes(content if isinstance(content, bytes) else content.encode())
    area, width, height = area_and_size(tmp_path / "a.svg", 0.01)
    assert area == pytest.approx(5.9 * 3.9 - 0.1 * 2.5, abs=0.12)
    assert (width, height) == (pytest.approx(5.9, abs=0.06), pytest.approx(3.9, abs=0.06))


LINES = [(0, 0, 6, 0), (6, 0, 6, 4), (6, 4, 0, 4), (0, 4, 0, 0), (3, 0, 3, 2.5)]
ROOM_M2 = pytest.approx(5.9 * 3.9 - 0.1 * 2.45, abs=0.1)
UNITS = {"mm": (4, 0.001), "cm": (5, 0.01), "m": (6, 1.0), "inches": (1, 0.0254), "feet": (2, 0.3048)}


def dxf(name):
    """Return the text of a drawing of the room."""
    ezdxf = pytest.importorskip("ezdxf", reason="ezdxf is not installed: extra [dxf]")
    version = "R12" if name == "R12" else "R2010"
    code, unit = UNITS.get(name, (6, 1.0))
    document = ezdxf.new(version, units=code)
    space = document.modelspace()
    lines = [tuple(value / unit for value in line) for line in LINES]
    if name == "polylines":
        space.add_lwpolyline([(0, 0), (6, 0), (6, 4), (0, 4)], close=True)
        space.add_lwpolyline([(3, 0), (3, 2.5)])
    elif name == "closed by hand":
        space.add_lwpolyline([(0, 0), (6, 0), (6, 4), (0, 4), (0, 0)])
        space.add_polyline3d([(3, 0, 0), (3, 1, 2), (3, 2.5, 0)])
    elif name in ("block", "mirrored block", "block in a block", "scaled block"):
        factor = 1000.0 if name == "scaled block" else 1.0
        block = document.blocks.new("PLAN")
        for x1, y1, x2, y2 in lines:
            block.add_line((factor * x1, factor * y1), (factor * x2, factor * y2))
        scale = {"xscale": -1.0 / factor if "mirrored" in name else 1.0 / factor, "yscale": 1.0 / factor}
        around = document.blocks.new("AROUND") if name == "block in a block" else space
        around.add_blockref("PLAN", (40, -7), scale | ({"rotation": 180.0} if name == "block" else {}))
        if name == "block in a block":
            space.add_blockref("AROUND", (3, 3))
    else:
        for x1, y1, x2, y2 in reversed(lines) if name == "other order" else lines:
            space.add_line((x1, y1), (x2, y2))
    import io

    stream = io.StringIO()
    document.write(stream)
    return stream.getvalue()


DRAWN = [
    *UNITS,
    *(
        "R12",
        "polylines",
        "closed by hand",
        "block",
        "mirrored block",
        "block in a block",
        "scaled block",
        "other order",
    ),
]


@pytest.mark.parametrize("name", DRAWN)
def test_a_drawing_of_dxf_is_the_same_in_every_form(name, tmp_path):
    text = dxf(name)
    forms = [text, text.replace("\n", "\r\n")] + ([] if name != "m" else [text.replace("\n  ", "\n"), "\ufeff" + text])
    for content in forms:
        (tmp_path / "a.dxf").write_bytes(content.encode())
        area, width, height = area_and_size(tmp_path / "a.dxf", 1.0 if name == "R12" else None)
        assert area == ROOM_M2
        assert (width, height) == (pytest.approx(6.1, abs=0.02), pytest.approx(4.1, abs=0.02))


def outline_files():
    """Yield a name and a text of each other format of plans, and its other forms."""
    rows = [tuple(10 * value for value in line) for line in LINES]
    amrl = "".join(f"{a}, {b}, {c}, {d}\n" for a, b, c, d in LINES)
    yield "a.vectormap.txt", None, amrl, [amrl.replace(", ", ","), amrl.replace(", ", "\t,")]
    corners = [[0, 0], [6, 0], [6, 4], [0, 4]]
    expo = json.dumps({"id": "h", "verts": [*corners, [0, 0]]}) + "\n"
    yield "a.json", None, expo, [json.dumps({"verts": corners, "room_num": 1}, indent=1), expo.replace("0", "0.0")]
    octile = ["@" * 14, *["@" + "." * 12 + "@"] * 8, "@" * 14]
    grid = "type octile\nheight 10\nwidth 14\nmap\n" + "\n".join(octile) + "\n"
    yield "a.map", 0.5, grid, [grid.replace(".", "G"), grid.replace("@", "T")]
    xml = "".join(f'<linesegment x1="{a}" y1="{b}" x2="{c}" y2="{d}" type="Wall"/>' for a, b, c, d in rows)
    kth = (
        '<?xml version="1.0"?>\n<floor><Scale PixelDistance="10" RealDistance="1.0"/>'
        f'<space name="a"><contour>{xml}</contour></space></floor>\n'
    )
    yield "a.xml", None, kth, [kth.replace("><", ">\n <"), kth.replace('"', "'")]


@pytest.mark.parametrize(("name", "resolution", "text", "others"), list(outline_files()), ids=lambda each: "")
def test_a_plan_is_the_same_in_every_form(name, resolution, text, others, tmp_path):
    (tmp_path / name).write_text(text)
    expected = area_and_size(tmp_path / name, resolution)
    assert expected[0] > 15.0
    for content in [*(content for _, content in encodings(text)), *(other.encode() for other in others)]:
        (tmp_path / name).write_bytes(content)
        assert area_and_size(tmp_path / name, resolution) == expected
        (tmp_path / f"{name}.gz").write_bytes(gzip.compress(content))
        assert area_and_size(tmp_path / f"{name}.gz", resolution) == expected


# Worlds

BOXES = [(0, -4, 10.2, 0.2), (0, 4, 10.2, 0.2), (-5, 0, 0.2, 8.2), (5, 0, 0.2, 8.2)]
POST = (-1, 2, 0.6, 0.6)


def collision(wide, high, pose="", kind="box"):
    shapes = {
        "box": f"<box><size>{wide} {high} 1</size></box>",
        "polyline": "<polyline>"
        + "".join(
            f"<point>{x * wide} {y * high}</point>" for x, y in ((-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5))
        )
        + "<height>1</height></polyline>",
    }
    return f'<collision name="c">{pose}<geometry>{shapes[kind]}</geometry></collision>'


def model(name, body, pose=""):
    return f'<model name="{name}">{pose}<link name="l">{body}</link></model>'


def hall():
    return "".join(
        model(f"wall_{k}", collision(w, h), f"<pose>{x} {y} 0.5 0 0 0</pose>") for k, (x, y, w, h) in enumerate(BOXES)
    )


def sdf(post, version="1.6", extra=""):
    return f'<?xml version="1.0"?>\n<sdf version="{version}"><world name="w">{hall()}{post}{extra}</world></sdf>\n'


BOX = collision(0.6, 0.6)
PLAIN_SDF = sdf(model("post", BOX, "<pose>-1 2 0.5 0 0 0</pose>"))
QUARTER = math.pi / 2.0
SDFS = {
    **dict(encodings(PLAIN_SDF)),
    "pose in lines": PLAIN_SDF.replace("-1 2 0.5 0 0 0", "\n  -1.0 2e0\n 5e-1\t0 -0 0.0 \n"),
    "pose of a link": sdf(f'<model name="p"><link name="l"><pose>-1 2 0.5 0 0 0</pose>{BOX}</link></model>'),
    "pose of a collision": sdf(model("p", collision(0.6, 0.6, "<pose>-1 2 0.5 0 0 0</pose>"))),
    "poses of all": sdf(
        '<model name="p"><pose>-3 1 0 0 0 1.5707963267948966</pose><link name="l"><pose>1 0 0.5 0 0 0</pose>'
        + collision(0.6, 0.6, "<pose>0 -2 0 0 0 0</pose>")
        + "</link></model>"
    ),
    "turned by a quarter": sdf(model("p", BOX, f"<pose>-1 2 0.5 0 0 {QUARTER}</pose>")),
    "laid on its side": sdf(
        model(
            "p",
            '<collision name="c"><geometry><box><size>1 0.6 0.6</size></box></geometry></collision>',
            f"<pose>-1 2 0.5 0 {QUARTER} 0</pose>",
        )
    ),
    "degrees": sdf(model("p", BOX, '<pose degrees="true">-1 2 0.5 0 0 90</pose>'), "1.9"),
    "quaternion": sdf(
        model("p", BOX, '<pose rotation_format="quat_xyzw">-1 2 0.5 0 0 0.7071068 0.7071068</pose>'), "1.9"
    ),
    "polyline": sdf(model("p", collision(0.6, 0.6, kind="polyline"), "<pose>-1 2 0 0 0 0</pose>")),
    "relative to a frame": sdf(
        '<frame name="f"><pose>3 3 0 0 0 0</pose></frame>'
        + model("p", BOX, '<pose relative_to="f">-4 -1 0.5 0 0 0</pose>'),
        "1.9",
    ),
    "relative to a turned frame": sdf(
        f'<frame name="f"><pose>1 1 0 0 0 {QUARTER}</pose></frame>'
        + model("p", BOX, '<pose relative_to="f">1 2 0.5 0 0 0</pose>'),
        "1.9",
    ),
    "relative to a model": sdf(model("p", BOX, '<pose relative_to="wall_1">-1 -2 0 0 0 0</pose>'), "1.9"),
    "attached frame": sdf(
        '<frame name="g" attached_to="wall_1"><pose>0 -1 0 0 0 0</pose></frame>'
        + model("p", BOX, '<pose relative_to="g">-1 -1 0 0 0 0</pose>'),
        "1.9",
    ),
    "model in a model": sdf(
        '<model name="q"><pose>-2 1 0 0 0 0</pose>' + model("p", BOX, "<pose>1 1 0.5 0 0 0</pose>") + "</model>", "1.9"
    ),
    "two links": sdf(
        '<model name="p"><link name="a"><pose>1 0 0 0 0 0</pose></link><link name="b">'
        f'<pose relative_to="a">-2 2 0.5 0 0 0</pose>{BOX}</link></model>',
        "1.9",
    ),
    "included": sdf("<include><uri>model://post</uri><pose>-1 2 0.5 0 0 0</pose></include>"),
    "included with a name": sdf("<include><name>a</name><uri>model://post</uri><pose>-1 2 0.5 0 0 0</pose></include>"),
    "included as file": sdf("<include><uri>file://post</uri><pose>-1 2 0.5 0 0 0</pose></include>"),
    "included where it stands": sdf("<include><uri>model://standing</uri></include>"),
    "included within": sdf("<include><uri>model://around</uri><pose>-2 1 0 0 0 0</pose></include>", "1.9"),
    "more elements": sdf(
        model("post", BOX.replace("</geometry>", "</geometry><surface/>"), "<pose>-1 2 0.5 0 0 0</pose>"),
        extra='<light name="sun" type="directional"/><physics type="ode"/><include><uri>model://sun</uri></include>',
    ),
    "remarks": sdf("<!-- a -- post -->" + model("post", BOX, "<pose><!-- x -->-1 2 0.5 0 0 0</pose>")),
    "visuals": sdf(
        model("post", BOX + BOX.replace("collision", "visual").replace("0.6 0.6", "9 9"), "<pose>-1 2 0.5 0 0 0</pose>")
    ),
    "saved state": sdf(
        model("post", BOX, "<pose>3 3 0.5 0 0 0</pose>"),
        extra='<state world_name="w"><model name="post"><pose>-1 2 0.5 0 0 0</pose></model></state>',
    ),
}
INCLUDED = {
    "post": model("post", BOX),
    "standing": model("standing", BOX, "<pose>-1 2 0.5 0 0 0</pose>"),
    "around": '<model name="around"><include><uri>model://post</uri><pose>1 1 0.5 0 0 0</pose></include></model>',
}


@pytest.mark.parametrize("name", SDFS)
def test_a_world_of_gazebo_is_the_same_in_every_form(name, tmp_path):
    for folder, body in INCLUDED.items():
        (tmp_path / "models" / folder).mkdir(parents=True)
        (tmp_path / "models" / folder / "model.sdf").write_text(f'<sdf version="1.9">{body}</sdf>')
    content = SDFS[name]
    (tmp_path / "a.world").write_bytes(content if isinstance(content, bytes) else content.encode())
    floor = load_file(tmp_path / "a.world")
    assert not floor.remark
    assert floor.bounds == pytest.approx((-5.1, -4.1, 5.1, 4.1))
    assert describe_floor(floor)["area_m2"] == pytest.approx(9.8 * 7.8 - 0.36, abs=0.01)
    x, y, wide, high = POST
    (post,) = [solid.polygon for solid in floor.solids if np.ptp(solid.polygon, axis=0).max() < 2.0]
    assert post.min(axis=0) == pytest.approx((x - wide / 2, y - high / 2), abs=1e-5)
    assert post.max(axis=0) == pytest.approx((x + wide / 2, y + high / 2), abs=1e-5)


STAGE = """define plan model
(
  boundary 1
)
plan
(
  size [6.0 4.0 1.0]
  pose [1 2 0 0]
  bitmap "map.pgm"
)
define rover position ( size [0.4 0.4 0.2] )
rover ( pose [ 0 1 0 90 ] color "red" )
"""
STAGES = {
    **dict(encodings(STAGE)),
    "one line": " ".join(STAGE.split()),
    "remarks": STAGE.replace("(\n", "( # a remark ( [\n"),
    "no blanks": STAGE.replace(" (", "(").replace("[ ", "[").replace(" ]", "]"),
    "without a definition": STAGE.replace("define rover position ( size [0.4 0.4 0.2] )", "").replace(
        "rover", "position"
    ),
    "other order": "\n".join(STAGE.splitlines()[-2:] + STAGE.splitlines()[:-2]) + "\n",
    "numbers": STAGE.replace("6.0 4.0 1.0", "6 4e0 1").replace("[1 2 0 0]", "[ 1.0 2.0 0.0 360.0 ]"),
    "old pose": STAGE.replace("[1 2 0 0]", "[1 2 0]").replace("[6.0 4.0 1.0]", "[6 4]"),
    "included": 'include "plan.inc"\n' + STAGE.split(")\n", 1)[1],
    "defined wholly": STAGE.replace("boundary 1", 'boundary 1 bitmap "map.pgm" size [6 4 1]').replace(
        'bitmap "map.pgm"\n)', ")", 1
    ),
    "more properties": "resolution 0.02\ninterval_sim 100\nwindow ( size [ 600 400 ] scale 20 )\n" + STAGE,
}


@pytest.mark.parametrize("name", STAGES)
def test_a_world_of_stage_is_the_same_in_every_form(name, tmp_path):
    (tmp_path / "map.pgm").write_bytes(netpbm("P5", room(), 255))
    (tmp_path / "plan.inc").write_text(STAGE.split(")\n", 1)[0] + ")\n")
    content = STAGES[name]
    (tmp_path / "a.world").write_bytes(content if isinstance(content, bytes) else content.encode())
    floor = load_file(tmp_path / "a.world")
    assert describe_floor(floor)["area_m2"] == pytest.approx(21.65, abs=0.1)
    assert floor.starts == pytest.approx(np.array([[0.0, 1.0, math.pi / 2.0]]))
    assert np.add(floor.bounds[:2], floor.bounds[2:]) / 2.0 == pytest.approx((1.0, 2.0), abs=0.06)
