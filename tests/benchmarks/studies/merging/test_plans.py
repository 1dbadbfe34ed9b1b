"""Sensor maps on drawn plans of unknown scale: rows of pairs, and the tables of them."""

import gzip
import json
import math

import cv2
import numpy as np
import pytest
from drawn_maps import blank, hall, moved, room

from lidarium.benchmarks.studies.merging.plans import merge_plans, plan_tables
from lidarium.benchmarks.studies.merging.real_maps import HALMSTAD_M
from lidarium.mapping.files.map_files import write_ros_map
from lidarium.mapping.geometry.rigid import Transform

SCALE = 0.8
PIXELS = 1000


def pixels(points):
    """Pixels whose y runs down of points [m]."""
    return (np.column_stack([points[:, 0], PIXELS * HALMSTAD_M - points[:, 1]]) / HALMSTAD_M).tolist()


@pytest.fixture(scope="module")
def rows(tmp_path_factory):
    """Rows of a folder with a plan, the map that a robot made of the same floor, and a map of another."""
    folder = tmp_path_factory.mktemp("data")
    halmstad = folder / "map_pairs" / "halmstad"
    halmstad.mkdir(parents=True)
    floor = np.kron(hall(), np.ones((2, 2), np.uint8))
    plan_from_sensor = Transform(1.0, 2.0, 0.1)
    there = Transform(plan_from_sensor.x / SCALE, plan_from_sensor.y / SCALE, plan_from_sensor.theta)
    small = cv2.resize(moved(floor, there, (1250, 1250), HALMSTAD_M), (PIXELS, PIXELS), interpolation=cv2.INTER_NEAREST)
    sensor = np.full((PIXELS, PIXELS), 127, np.uint8)
    sensor[: floor.shape[0], : floor.shape[1]] = floor
    for name, levels in (("E5_07", sensor), ("E5_layout", small)):
        assert cv2.imwrite(str(halmstad / f"{name}.png"), levels[::-1])
    points = np.random.default_rng(0).uniform(1.0, 6.0, (9, 2))
    truth = {
        "src_pts": pixels(points),
        "dst_pts": pixels(plan_from_sensor.apply(SCALE * points)),
        "theta_deg": -math.degrees(plan_from_sensor.theta),
        "scale": SCALE,
        "usable": False,
    }
    content = {"E5_07__E5_layout": truth, "E5_07__E5_09": truth}
    (halmstad / "ground_truth.json.gz").write_bytes(gzip.compress(json.dumps(content).encode()))
    write_ros_map(folder / "slam_maps", "other", room(blank(), 20, 20, 90, 130), (0.0, 0.0, 0.0), 0.05)
    return merge_plans(folder)


def test_a_map_is_laid_on_its_plan_and_strangers_are_not(rows):
    plan, *strangers = rows
    assert (plan["pair"], plan["building"]) == ("E5_07__E5_layout", "E5")
    assert plan["is_accepted"]
    assert plan["is_right"]
    assert plan["distance_m"] < 0.1
    assert plan["scale"] == pytest.approx(SCALE, rel=0.02)
    assert [row["pair"] for row in strangers] == ["other, E5_layout"]
    assert not strangers[0]["is_accepted"]


def test_the_page_says_what_is_right_and_each_pair(rows):
    page = plan_tables(rows)
    assert "| `E5` | 1 | 100.0 % (1 of 1;" in page
    assert "| `strangers` | 1 | - | 0.0 % (0 of 1;" in page
    assert "| E5_07__E5_layout | joined | " in page
    assert "| 0.98 | 100.0 % (1 of 1;" in page


def test_a_folder_without_plans_has_no_rows(tmp_path):
    assert merge_plans(tmp_path) == []
