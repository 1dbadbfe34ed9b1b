"""Bytes that LZF packed."""

import struct
import zlib

import numpy as np
import pytest
from cloud_files import POINTS, pcd

from lidarium.mapping.point_clouds.reading import read_cloud


def test_lzf_pieces_that_come_again_are_unpacked(tmp_path):
    points = np.zeros((100, 3), np.float32)
    # A zero as it is, then zeros from one byte back: 264, 264, and so on.
    left, packed = 1199, b"\x00\x00"
    while left > 264:
        packed, left = packed + bytes([0xE0, 255, 0]), left - 264
    packed += bytes([0xE0, left - 9, 0])
    body = struct.pack("<II", len(packed), 1200) + packed
    (tmp_path / "a.pcd").write_bytes(pcd("binary_compressed", points=100, body=body))
    assert (read_cloud(tmp_path / "a.pcd").points == points).all()


def test_packed_bytes_of_another_packer_are_refused(tmp_path):
    body = struct.pack("<II", 100, 36) + zlib.compress(POINTS.tobytes()).ljust(100, b"\0")
    (tmp_path / "a.pcd").write_bytes(pcd("binary_compressed", body=body))
    with pytest.raises(ValueError, match="damaged"):
        read_cloud(tmp_path / "a.pcd")
