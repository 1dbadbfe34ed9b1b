"""What rooms would like to hold follows from their use."""

import numpy as np
import pytest

from lidarium.envs.floors.generation.furniture import PIECES
from lidarium.envs.floors.generation.room_wishes import APARTMENT, CORRIDORS, OFFICE, _office_use, room_wishes


def test_rooms_of_an_apartment_are_used_by_their_size():
    areas = np.array([9.0, 12.0, 4.0, 30.0, 7.0, 10.0])
    wishes = room_wishes("apartment", areas, np.random.default_rng(0))
    uses = [next(use for use, pieces in APARTMENT.items() if pieces == wish) for wish in wishes]
    assert uses == ["hall", "bedroom", "bath", "living", "kitchen", "child"]


def test_a_lone_room_is_a_bath_and_two_are_bath_and_living():
    for areas, uses in (([5.0, 20.0], ["hall", "bath"]), ([5.0, 20.0, 4.0], ["hall", "living", "bath"])):
        assert room_wishes("apartment", np.array(areas), np.random.default_rng(0)) == [
            APARTMENT[use] for use in uses
        ]


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
    wished = {
        piece for uses in (APARTMENT, OFFICE, CORRIDORS) for pieces in uses.values() for piece in pieces
    }
    assert wished <= set(PIECES)
    assert len(room_wishes("corridors", np.array([50.0]), np.random.default_rng(0))) == 1
