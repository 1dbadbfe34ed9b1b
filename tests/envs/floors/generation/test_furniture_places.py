"""Furniture stands against walls or free, off doors and passages."""

import numpy as np
import pytest

from lidarium.envs.floors.generation.furniture_places import DOOR_DEPTH, PASSAGE, FurniturePlaces, _gap
from lidarium.envs.floors.generation.plans import Boundary, Door

LABELS = np.full((62, 82), -1, np.int32)
LABELS[1:-1, 1:41], LABELS[1:-1, 41:-1] = 0, 1
DOOR = Door(Boundary(True, 4.1, 0.1, 6.1, 0, 1), 2.0, 2.9)


def drawn(names, seed=0, size=(1.0, 0.5)):
    places, generator = FurniturePlaces(LABELS, [DOOR], 0.1), np.random.default_rng(seed)
    found = [places.draw(0, name, *size, generator) for name in names]
    return [piece for piece in found if piece is not None]


def test_a_gap_is_the_larger_distance_and_less_than_0_where_rectangles_overlap():
    assert _gap((0, 0, 1, 1), (3, 1.5, 4, 2)) == 2
    assert _gap((0, 0, 2, 2), (1, 1, 3, 3)) == -1


@pytest.mark.parametrize("seed", range(6))
def test_pieces_are_in_their_room_off_the_door_and_apart_from_each_other(seed):
    found = drawn(["shelf", "cabinet", "table", "box", "shelf", "table"], seed)
    assert len(found) >= 3
    door = (4.1 - DOOR_DEPTH, 1.9, 4.1 + DOOR_DEPTH, 3.0)
    for k, piece in enumerate(found):
        left, low, right, high = piece.footprint
        assert 0.1 <= left < right <= 4.1 + 1e-6
        assert 0.1 <= low < high <= 6.1 + 1e-6
        assert _gap(piece.footprint, door) > 0.0
        for other in found[:k]:
            gap = _gap(piece.footprint, other.footprint)
            assert gap >= 0.02 - 1e-9
            assert gap >= PASSAGE - 1e-9 or min(
                np.abs(np.subtract(piece.footprint, other.footprint)).tolist()
            ) == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("seed", range(6))
def test_backs_are_at_walls_and_tables_stand_free(seed):
    (shelf,), (table,) = drawn(["shelf"], seed), drawn(["table"], seed)
    left, low, right, high = shelf.footprint
    assert min(left - 0.1, low - 0.1, 4.1 - right, 6.1 - high) <= 0.1
    left, low, right, high = table.footprint
    assert min(left - 0.1, low - 0.1, 4.1 - right, 6.1 - high) >= PASSAGE - 0.06


def test_a_piece_wider_than_all_walls_has_no_place():
    assert drawn(["shelf"], size=(7.0, 0.5)) == []
