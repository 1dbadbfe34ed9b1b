"""What several importers share."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from lidarium.envs.floors.importers import common


@pytest.mark.parametrize(
    ("name", "wanted"),
    [
        ("a.b.xml", "a.b"),
        ("hall.vectormap.txt", "hall"),
        ("floor.XML.gz", "floor"),
        ("plan.v2.png", "plan.v2"),
        ("plain", "plain"),
    ],
)
def test_a_floor_is_named_without_what_says_the_format(name, wanted):
    assert common.floor_name(Path("folder") / name) == wanted


def test_parts_are_passed_on_up_to_the_most_points():
    half = common.MAX_POINTS // 2
    parts = common.few_enough(Path("a.dxf"), ["a", "b", "c"], lambda part: half)
    assert [next(parts), next(parts)] == ["a", "b"]
    with pytest.raises(ValueError, match=r"a\.dxf has more than 250,000 points"):
        next(parts)


def test_a_gap_in_the_outer_wall_is_closed_and_the_outline_is_in_the_middle_of_it():
    square = np.array([(0, 0, 4, 0), (4, 0, 4, 3), (4, 3, 0, 3), (0, 3, 0, 0.4)], np.float64)
    (ring,) = common.enclosed(Path("a"), square, np.zeros(2), np.array([4.0, 3.0]))
    assert cv2.contourArea(ring.astype(np.float32)) == pytest.approx(12.0, rel=0.03)
    assert ring.min() > -0.05


def test_cells_that_are_all_alike_are_no_floor():
    for cells, word in ((np.ones((4, 4), bool), "free"), (np.zeros((4, 4), bool), "solid")):
        with pytest.raises(ValueError, match=rf"a\.png is all {word}"):
            common.floor_of_cells(Path("a.png"), cells, (0.0, 0.0), 0.1)


def test_a_scale_beside_the_files_own_is_refused():
    common.refuse_resolution(Path("a.xml"), None)
    with pytest.raises(ValueError, match=r"has its own scale, but a resolution of 0\.1 m"):
        common.refuse_resolution(Path("a.xml"), 0.1)


@pytest.mark.parametrize("wall", [(0.0, 0.0, 4.0, 0.0), (0.0, 0.0, 4.0, 1.0), (1.0, 1.0, 1.0, 1.0)])
def test_a_lone_wall_encloses_nothing(wall):
    with pytest.raises(ValueError, match="a has no walls that enclose a space; want a floor plan"):
        common.floor_of_lines(Path("a"), np.array([wall]), np.zeros((0, 4)))
