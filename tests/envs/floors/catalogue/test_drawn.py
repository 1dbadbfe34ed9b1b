"""Drawn floors are short files."""

import json
import math

import numpy as np
import pytest

from lidarium.envs.floors.catalogue.drawn import _wall, about_drawn, drawn_names, load_drawn

PLAN = {
    "name": "hut",
    "about": "One room.",
    "bounds": [0, 0, 6, 4],
    "outer_wall": 0.2,
    "walls": [[3, 0, 3, 4, 0.2]],
    "doors": [[3, 2, 1.0]],
    "starts": [[1, 1, 90]],
    "goal": [5, 1],
}


@pytest.fixture
def written(tmp_path):
    def write(**changes):
        (tmp_path / "hut.json").write_text(json.dumps({**PLAN, **changes}))
        return tmp_path / "hut.json"

    return write


def test_a_door_is_a_gap_in_the_wall_through_its_middle(written):
    floor = load_drawn(written())
    assert floor.name == "hut"
    free = floor.raster(0.05, 0.3, 0.3).solid == 0
    assert free.sum() * 0.05**2 == pytest.approx(5.6 * 3.6 - 0.2 * 2.6, rel=0.01)
    assert floor.starts.tolist() == [[1.0, 1.0, math.pi / 2]]
    assert floor.goal == (5, 1)
    shut = load_drawn(written(doors=[[2, 2, 1.0]]))
    assert (shut.raster(0.05, 0.3, 0.3).solid == 0).sum() < free.sum()


def test_a_wall_is_half_its_thickness_longer_and_parted_by_its_doors():
    low, middle, high = _wall([0.0, 0.0, 5.0, 0.0, 0.2], [[3.0, 0.0, 1.0], [1.5, 0.05], [2.0, 1.0]])
    spans = [(piece.polygon[:, 0].min(), piece.polygon[:, 0].max()) for piece in (low, middle, high)]
    assert np.allclose(spans, [(-0.1, 1.05), (1.95, 2.5), (3.5, 5.1)])
    assert low.polygon[:, 1].max() == pytest.approx(0.1)


def test_outside_of_rooms_all_is_solid(written):
    floor = load_drawn(written(walls=[], doors=[], rooms=[[[1, 1], [4, 1], [4, 3], [1, 3]]]))
    assert (floor.raster(0.05, 0.3, 0.3).solid == 0).sum() * 0.05**2 == pytest.approx(6.0, rel=0.01)


def test_obstacles_have_their_height(written):
    box = {"corners": [[1, 1], [2, 1], [2, 2], [1, 2]], "height": 0.4}
    floor = load_drawn(written(obstacles=[box]))
    above, below = ((floor.raster(0.05, z, z).solid == 0).sum() for z in (0.5, 0.3))
    assert (above - below) * 0.05**2 == pytest.approx(1.0, rel=0.01)


def test_our_own_floors_have_a_sentence_each():
    assert "apartment" in drawn_names()
    assert not [name for name in drawn_names() if not about_drawn(name)]


def test_a_file_that_is_none_is_refused(tmp_path, written):
    with pytest.raises(FileNotFoundError):
        load_drawn(tmp_path / "none.json")
    for changes in ({"bounds": [0, 0, 6]}, {"walls": [["a", 0, 1, 1]]}, {"furniture": [["throne", 1, 1, 0]]}):
        with pytest.raises(ValueError, match=r"hut\.json"):
            load_drawn(written(**changes))
