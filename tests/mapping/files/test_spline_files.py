"""Spline maps as files."""

import json

import numpy as np
import pytest
from curved_room import LASER, ROOM, ROUND, taken
from polygon_scans import scan

from lidarium.mapping.files.spline_files import compact_bytes, read_spline_map, write_spline_map
from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.splines.features import observe, scan_points
from lidarium.mapping.splines.settings import SplineSettings
from lidarium.mapping.splines.spline_map import SplineMap


@pytest.fixture(scope="module")
def room_map():
    return taken()


def test_json_keeps_the_map_to_the_bit(room_map, tmp_path):
    write_spline_map(tmp_path / "room.json", room_map)
    read = read_spline_map(tmp_path / "room.json")
    np.testing.assert_array_equal(read.sample(), room_map.sample())
    np.testing.assert_array_equal(read.corners.points, room_map.corners.points)
    assert [curve.count for curve in read.curves] == [curve.count for curve in room_map.curves]


def test_the_compact_form_keeps_the_map_to_a_millimetre_and_can_go_on(room_map, tmp_path):
    write_spline_map(tmp_path / "room.npz", room_map)
    read = read_spline_map(tmp_path / "room.npz")
    for mine, theirs in zip(read.curves, room_map.curves, strict=True):
        assert theirs.spline.closest(mine.spline.sample(0.05))[1].max() < 0.0015
    np.testing.assert_allclose(read.peaks.points, room_map.peaks.points, atol=0.001)
    assert read.updates == room_map.updates
    before = len(read.curves)
    read.update(observe(scan_points(scan(ROOM, ROUND[0], LASER), LASER)), Transform(*ROUND[0]))
    assert len(read.curves) <= before + 1


def test_the_compact_form_is_small(room_map):
    assert compact_bytes(room_map) < 0.1 * 100 * 70


def test_a_blank_map_is_kept_too(tmp_path):
    for name in ("blank.json", "blank.npz"):
        write_spline_map(tmp_path / name, SplineMap())
        assert read_spline_map(tmp_path / name, SplineSettings()).curves == []


def test_files_that_are_no_maps_are_refused(room_map, tmp_path):
    with pytest.raises(ValueError, match=r"\.json or \.npz"):
        write_spline_map(tmp_path / "room.txt", room_map)
    with pytest.raises(FileNotFoundError, match="there is no file"):
        read_spline_map(tmp_path / "none.json")
    (tmp_path / "other.json").write_text(json.dumps({"version": 1}))
    (tmp_path / "broken.npz").write_bytes(b"PK not really")
    np.savez(tmp_path / "arrays.npz", frame=np.zeros(6))
    for name in ("other.json", "broken.npz", "arrays.npz"):
        with pytest.raises(ValueError, match="is not a spline map"):
            read_spline_map(tmp_path / name)
