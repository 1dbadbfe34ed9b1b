"""Pieces of furniture as solids with heights."""

import math

import cv2
import numpy as np
import pytest

from lidarium.envs.floors.floor import Floor
from lidarium.envs.floors.generation.furniture import (
    APARTMENT,
    CORRIDORS,
    DOOR_DEPTH,
    OFFICE,
    PASSAGE,
    PIECES,
    FurniturePlaces,
    _gap,
    _office_use,
    _room_wishes,
    furnish,
    place,
)
from lidarium.envs.floors.generation.layouts import Boundary, Door, choose_doors


@pytest.mark.parametrize("kind", PIECES)
def test_furniture_stays_within_its_footprint_and_below_the_ceiling(kind):
    piece = PIECES[kind]
    for width, depth in zip(piece.width, piece.depth, strict=True):
        solids = place(kind, 2.0, 3.0, math.pi / 2, width, depth)
        corners = np.concatenate([solid.polygon for solid in solids])
        assert (np.abs(corners - (2.0, 3.0)).max(axis=0) <= np.array([width, depth]) / 2 + 1e-3).all()
        assert all(0.0 <= solid.z_low < solid.z_high <= 2.0 for solid in solids)


def test_a_laser_sees_the_legs_of_a_table_and_a_tall_body_meets_its_top():
    table = Floor("table", (-2.0, -2.0, 2.0, 2.0), place("table", 0.0, 0.0, math.pi / 2, 1.2, 0.8))
    legs, top = table.raster(0.025, 0.3, 0.3).solid, table.raster(0.025, 0.0, 1.5).solid
    inner = (slice(10, -10), slice(10, -10))
    assert cv2.connectedComponents(legs[inner].copy())[0] - 1 == 4
    assert top[inner].sum() * 0.025**2 == pytest.approx(1.2 * 0.8, rel=0.1)
    assert legs[inner].sum() < 0.05 * top[inner].sum()


def test_furniture_of_an_unknown_kind_is_refused():
    with pytest.raises(ValueError, match="throne"):
        place("throne", 0.0, 0.0, 0.0)


def test_the_back_of_a_piece_is_where_its_direction_points():
    for theta in (0.0, math.pi / 2, math.pi, -math.pi / 2):
        solids = place("bed", 2.0, 3.0, theta, 1.6, 2.0)
        board = next(solid for solid in solids if solid.z_high == 1.0)
        back = board.polygon.mean(axis=0) - (2.0, 3.0)
        assert back @ (math.cos(theta), math.sin(theta)) == pytest.approx(0.97, abs=1e-3)


def test_rooms_of_an_apartment_are_used_by_their_size():
    areas = np.array([9.0, 12.0, 4.0, 30.0, 7.0, 10.0])
    wishes = _room_wishes("apartment", areas, np.random.default_rng(0))
    uses = [next(use for use, pieces in APARTMENT.items() if pieces == wish) for wish in wishes]
    assert uses == ["hall", "bedroom", "bath", "living", "kitchen", "child"]


def test_a_lone_room_is_a_bath_and_two_are_bath_and_living():
    for areas, uses in (([5.0, 20.0], ["hall", "bath"]), ([5.0, 20.0, 4.0], ["hall", "living", "bath"])):
        assert _room_wishes("apartment", np.array(areas), np.random.default_rng(0)) == [APARTMENT[use] for use in uses]


@pytest.mark.parametrize(
    ("area", "draw", "use"),
    [
        (6.0, 0.4, "washroom"),
        (6.0, 0.6, "store"),
        (12.0, 0.8, "office"),
        (12.0, 0.9, "store"),
        (18.0, 0.2, "meeting"),
        (18.0, 0.4, "office"),
        (30.0, 0.4, "open office"),
    ],
)
def test_small_rooms_of_an_office_are_no_meeting_rooms(area, draw, use):
    assert _office_use(area, draw) == use


def test_all_that_is_wished_for_exists():
    wished = {piece for uses in (APARTMENT, OFFICE, CORRIDORS) for pieces in uses.values() for piece in pieces}
    assert wished <= set(PIECES)
    assert len(_room_wishes("corridors", np.array([50.0]), np.random.default_rng(0))) == 1


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


LABELS_OF_FURNISHING = np.full((82, 122), -1, np.int32)
LABELS_OF_FURNISHING[1:31, 1:-1] = 0
LABELS_OF_FURNISHING[31:-1, 1:61], LABELS_OF_FURNISHING[31:-1, 61:-1] = 1, 2


def furnished(clutter, seed=1):
    generator = np.random.default_rng(seed)
    doors = choose_doors(LABELS_OF_FURNISHING, 0.9, 0.0, generator)
    return furnish("apartment", LABELS_OF_FURNISHING, doors, clutter, 0.1, generator)


def covered(pieces):
    return sum(math.prod(np.subtract(piece.footprint[2:], piece.footprint[:2])) for piece in pieces)


def test_without_clutter_nothing_stands_there():
    assert furnished(0.0) == []


@pytest.mark.parametrize("clutter", [0.05, 0.1])
def test_about_as_much_is_covered_as_is_asked_for(clutter):
    area = 8.0 * 12.0
    assert covered(furnished(clutter)) == pytest.approx(clutter * area, abs=1.5)


def test_no_room_is_covered_beyond_what_fits():
    pieces = furnished(0.9)
    assert 0.1 * 96.0 < covered(pieces) < 0.6 * 96.0
    assert {piece.room for piece in pieces} == {0, 1, 2}


def test_the_same_draws_give_the_same_pieces():
    first, again = furnished(0.1), furnished(0.1)
    assert [piece.footprint for piece in first] == [piece.footprint for piece in again]
