import gzip
import json
import math

import cv2
import numpy as np
import pytest
from drawn_maps import apartment, blank, moved, room

from lidarium.benchmarks.studies.merging.real_maps import (
    HALMSTAD_M,
    REAL_M,
    correspondence_error,
    merge_real_maps,
    real_maps,
    transform_of_pixels,
)
from lidarium.mapping.files.map_files import write_ros_map
from lidarium.mapping.geometry.rigid import Transform


def save(path, levels):
    path.parent.mkdir(parents=True, exist_ok=True)
    assert cv2.imwrite(str(path), levels[::-1])


def large():
    return np.kron(apartment(), np.ones((2, 2), np.uint8))


def pixels(points, rows, resolution):
    """Pixels whose y runs down of points [m]."""
    return np.column_stack([points[:, 0], rows * resolution - points[:, 1]]) / resolution


@pytest.fixture
def data(tmp_path):
    """A folder as that of real data: a pair with correspondences, one with pixels, and two buildings."""
    pairs = tmp_path / "map_pairs"
    truth = Transform(4.0, 3.0, 0.5)
    other = moved(large(), truth, (700, 700), HALMSTAD_M)
    save(pairs / "halmstad" / "E5_01.png", large())
    save(pairs / "halmstad" / "E5_02.png", other)
    points = np.random.default_rng(0).uniform(1.0, 6.0, (9, 2))
    entry = {
        "src_pts": pixels(points, len(large()), HALMSTAD_M).tolist(),
        "dst_pts": pixels(truth.apply(points), len(other), HALMSTAD_M).tolist(),
        "theta_deg": -math.degrees(truth.theta),
        "usable": True,
    }
    cosine, sine = math.cos(truth.theta), -math.sin(truth.theta)
    turned = np.array([[cosine, -sine], [sine, cosine]]) @ entry["src_pts"][0]
    entry["tx"], entry["ty"] = (entry["dst_pts"][0] - turned).tolist()
    content = {"E5_01__E5_02": entry, "E5_01__E5_layout": {**entry, "usable": False}}
    (pairs / "halmstad" / "ground_truth.json.gz").write_bytes(gzip.compress(json.dumps(content).encode()))
    save(pairs / "real" / "one_A.png", apartment())
    save(pairs / "real" / "one_B.png", apartment()[:, :150])
    exact = {"one": {"A": "one_A.png", "B": "one_B.png", "theta_deg": 0.0, "tx": 0.0, "ty": 0.0}}
    (pairs / "real" / "ground_truth.json").write_text(json.dumps(exact))
    write_ros_map(tmp_path / "slam_maps", "first", apartment(), (0.0, 0.0, 0.0), REAL_M)
    write_ros_map(tmp_path / "slam_maps", "second", room(blank(), 20, 20, 90, 130), (0.0, 0.0, 0.0), 0.1)
    return tmp_path


def test_pairs_of_one_building_and_strangers_are_told_apart(data):
    rows = merge_real_maps(data)
    halmstad, real, *strangers = rows
    assert (halmstad["pair"], halmstad["collection"]) == ("E5_01__E5_02", "halmstad")
    assert halmstad["is_tuned"]
    assert halmstad["is_accepted"]
    assert halmstad["is_right"]
    assert halmstad["distance_m"] < 0.05
    assert halmstad["is_calibrated"]
    assert 0.0 < halmstad["deviations"] < 2.0
    assert not real["is_tuned"]
    assert real["is_right"]
    assert real["distance_m"] == pytest.approx(0.0, abs=1e-6)
    assert [row["pair"] for row in strangers] == [
        "first, second",
        "first, E5_01",
        "second, E5_01",
    ]
    assert not any(row["is_accepted"] for row in strangers)


def test_the_page_tells_recall_wrong_ones_and_what_is_missed(data):
    page = real_maps(merge_real_maps(data))
    assert "| `halmstad E5` | yes | 1 | 100.0 % (1 of 1;" in page
    assert "| `strangers` | no | 2 | - | 0.0 % (0 of 2;" in page
    assert "| 0.8 | 100.0 % (2 of 2;" in page
    assert "| every other pair of E5 and the easy halves of logs | yes | 100.0 % (1 of 1;" in page
    assert "| the others | no | 100.0 % (1 of 1;" in page


def test_a_folder_without_maps_has_no_rows(tmp_path):
    assert merge_real_maps(tmp_path) == []


def test_errors_are_those_of_correspondences():
    truth = Transform(1.0, -2.0, 0.3)
    points = np.random.default_rng(1).uniform(0.0, 8.0, (7, 2))
    entry = {
        "src_pts": pixels(points, 300, 0.05),
        "dst_pts": pixels(truth.apply(points), 200, 0.05),
        "theta_deg": -math.degrees(0.3),
    }
    assert correspondence_error(entry, 0.05, (200, 300), truth) == pytest.approx((0.0, 0.0), abs=1e-9)
    moved_on = Transform(1.5, -2.0, 0.3)
    assert correspondence_error(entry, 0.05, (200, 300), moved_on) == pytest.approx((0.5, 0.0), abs=1e-9)


def test_a_transform_of_pixels_that_run_down_is_turned_round():
    truth = transform_of_pixels({"theta_deg": 30.0, "tx": 1.0, "ty": -2.0}, 0.1, 40, 50)
    pixel_b = np.array([7.0, 11.0])
    pixel_a = Transform(1.0, -2.0, math.radians(30.0)).apply(pixel_b)
    place_b = np.array([pixel_b[0], 50.0 - pixel_b[1]]) * 0.1
    np.testing.assert_allclose(truth.apply(place_b), np.array([pixel_a[0], 40.0 - pixel_a[1]]) * 0.1)
