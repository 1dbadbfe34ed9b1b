"""Codes with much empty room in their boxes are cut; others stay whole."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lidarium.mapping.sparse.mapper.code_boxes import boxes_of
from lidarium.mapping.sparse.mapper.code_cutting import LEAST_GAIN, LEAST_POINTS, cut_labels
from lidarium.mapping.sparse.mapper.full import map_cloud
from lidarium.mapping.sparse.settings import MapperSettings

PAD = 0.02


def corner(x=0.0):
    """Points of two walls that meet, 1 m long and 0.5 m high, 5 cm apart."""
    along, up = np.meshgrid(np.arange(0.0, 1.0, 0.05), np.arange(0.0, 0.5, 0.05))
    one = np.stack([along.ravel() + x, np.zeros(along.size), up.ravel()], axis=1)
    other = np.stack([np.full(along.size, x), along.ravel() + 0.05, up.ravel()], axis=1)
    return np.concatenate([one, other])


def room_of(points, labels):
    boxes = boxes_of(points, labels, int(labels.max()) + 1)
    return float(np.prod(boxes[:, 1] - boxes[:, 0] + PAD, axis=1).sum())


def test_a_corner_becomes_its_two_walls():
    points = corner()
    found = cut_labels(points, np.zeros(len(points), np.int64), PAD)
    boxes = boxes_of(points, found, int(found.max()) + 1)
    thin = (boxes[:, 1] - boxes[:, 0])[:, :2].min(axis=1)
    assert thin.max() < 0.11
    # What lies inside of the corner is in no box any more.
    inside = np.array([0.5, 0.5, 0.2])
    assert not ((boxes[:, 0] <= inside) & (inside <= boxes[:, 1])).all(axis=1).any()


def test_a_wall_and_a_full_block_stay_whole():
    wall = corner()[:200]
    block = np.stack(np.meshgrid(*[np.arange(0.0, 0.5, 0.05)] * 3), axis=-1).reshape(-1, 3)
    for points in (wall, block):
        assert cut_labels(points, np.zeros(len(points), np.int64), PAD).tolist() == [0] * len(points)


def test_so_many_cuts_are_made_as_are_allowed_the_largest_first():
    points = np.concatenate([corner(), 0.5 * corner() + [5.0, 0.0, 0.0]])
    labels = np.repeat([0, 1], len(points) // 2)
    rooms = []
    for most in range(6):
        found = cut_labels(points, labels, PAD, most)
        assert found.max() + 1 <= 2 + most
        rooms.append(room_of(points, found))
    assert rooms == sorted(rooms, reverse=True)
    once = cut_labels(points, labels, PAD, 1)
    assert len(np.unique(once[labels == 0])) == 2
    assert len(np.unique(once[labels == 1])) == 1
    assert np.array_equal(cut_labels(points, labels, PAD, 1000), cut_labels(points, labels, PAD))


@given(
    st.lists(st.tuples(*[st.integers(0, 20)] * 3), min_size=1, max_size=60),
    st.integers(1, 4),
    st.randoms(use_true_random=False),
)
def test_pieces_lie_within_codes_and_take_less_room(cells, codes, random):
    points = 0.05 * np.array(cells, np.float64)
    labels = np.unique([random.randrange(codes) for _ in cells], return_inverse=True)[1]
    found = cut_labels(points, labels, PAD)
    assert set(found) == set(range(found.max() + 1))
    for piece in range(found.max() + 1):
        code = np.unique(labels[found == piece])
        assert len(code) == 1
        is_whole = np.array_equal(found == piece, labels == code[0])
        assert is_whole or (found == piece).sum() >= LEAST_POINTS
    cuts = found.max() - labels.max()
    assert room_of(points, found) <= room_of(points, labels) + 1e-12
    if cuts == 1:
        code = next(c for c in range(labels.max() + 1) if len(np.unique(found[labels == c])) == 2)
        own = labels == code
        whole = room_of(points[own], np.zeros(own.sum(), np.int64))
        parts = room_of(points[own], np.unique(found[own], return_inverse=True)[1])
        assert parts <= (1.0 - LEAST_GAIN) * whole + 1e-12


@pytest.mark.parametrize("codes", [40, 80])
def test_a_whole_cloud_has_no_more_boxes_than_codes(codes):
    floor = np.stack(np.meshgrid(np.arange(0.0, 4.0, 0.05), np.arange(0.0, 4.0, 0.05)), axis=-1)
    ground = np.concatenate([floor.reshape(-1, 2), np.zeros((floor.size // 2, 1))], axis=1)
    places = [np.array([0.0, y, 0.15]) for y in (0.3, 2.0)]
    walls = np.concatenate([corner(x) + place for x in (0.2, 1.6, 3.0) for place in places])
    found = map_cloud(np.concatenate([ground, walls]), codes, MapperSettings())
    assert len(found.occupied) + len(found.ground) <= codes
