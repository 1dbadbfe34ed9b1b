"""Rooms are furnished until the wanted share is covered."""

import math

import numpy as np
import pytest

from lidarium.envs.floors.generation.furnishing import furnish
from lidarium.envs.floors.generation.plans import choose_doors

LABELS = np.full((82, 122), -1, np.int32)
LABELS[1:31, 1:-1] = 0
LABELS[31:-1, 1:61], LABELS[31:-1, 61:-1] = 1, 2


def furnished(clutter, seed=1):
    generator = np.random.default_rng(seed)
    doors = choose_doors(LABELS, 0.9, 0.0, generator)
    return furnish("apartment", LABELS, doors, clutter, 0.1, generator)


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
