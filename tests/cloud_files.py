"""Small clouds as files, for tests of their formats."""

import struct

import numpy as np

POINTS = np.array([[1.0, 2.0, 3.0], [-0.5, 0.25, 4.0], [0.0, -8.0, 1.5]], np.float32)


def literal_lzf(content):
    pieces = [content[start : start + 32] for start in range(0, len(content), 32)]
    return b"".join(bytes([len(piece) - 1]) + piece for piece in pieces)


def packed_body(content, size=None):
    packed = literal_lzf(content)
    return struct.pack("<II", len(packed), len(content) if size is None else size) + packed


def pcd(form="ascii", fields="x y z", size="4 4 4", kind="F F F", count=None, points=3, body=b""):
    counts = "" if count is None else f"COUNT {count}\n"
    header = f"VERSION 0.7\nFIELDS {fields}\nSIZE {size}\nTYPE {kind}\n{counts}WIDTH {points}\nHEIGHT 1\n"
    return f"{header}VIEWPOINT 0 0 0 1 0 0 0\nPOINTS {points}\nDATA {form}\n".encode() + body


def lines_of(points):
    return "".join(" ".join(map(str, row)) + "\n" for row in np.asarray(points).tolist()).encode()


def ply(form, rows, kinds="float float float", names="x y z", before="", count=3, after=b""):
    properties = "".join(f"property {kind} {name}\n" for kind, name in zip(kinds.split(), names.split(), strict=True))
    header = f"ply\nformat {form} 1.0\ncomment by hand\n{before}element vertex {count}\n{properties}"
    return f"{header}element face 0\nproperty list uchar int i\nend_header\n".encode() + rows + after
