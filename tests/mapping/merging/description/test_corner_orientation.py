"""The orientation of a corner follows from its eight neighbours."""

import math

import numpy as np
import pytest

from lidarium.mapping.merging.description.corner_orientation import orientation_table
from lidarium.mapping.merging.description.corners import STEP

TABLE = {
    0xD8: 45.0,
    0x63: 135.0,
    0x8D: 225.0,
    0x36: 315.0,
    0xF8: 45.0,
    0xE3: 135.0,
    0x8F: 225.0,
    0x3E: 315.0,
    0xFC: 22.5,
    0xF9: 67.5,
    0xF3: 112.5,
    0xE7: 157.5,
    0xCF: 202.5,
    0x9F: 247.5,
    0x3F: 292.5,
    0x7E: 337.5,
}


def angles_of(table):
    return {code: round(math.degrees((int(table[code]) - 1) * STEP), 9) for code in range(256) if table[code]}


def turned_code(code):
    return (code << 2 | code >> 6) & 0xFF


def mirrored_code(code):
    """Swap what lies left and right of the x axis."""
    return sum(1 << (-i % 8) for i in range(8) if code >> i & 1)


def test_the_table_holds_the_sixteen_corners():
    assert angles_of(orientation_table()) == TABLE


def test_the_table_looks_alike_in_all_directions():
    angles = angles_of(orientation_table("table", (4, 5, 6, 7)))
    for code, angle in angles.items():
        assert angles[turned_code(code)] == (angle + 90.0) % 360.0
        assert angles[mirrored_code(code)] == -angle % 360.0


@pytest.mark.parametrize(("rule", "counts"), [("table", (4, 4, 8, 8)), ("literal", (4, 12, 16, 8))])
def test_each_number_of_neighbours_can_be_had_alone(rule, counts):
    assert tuple(np.count_nonzero(orientation_table(rule, (r,))) for r in (4, 5, 6, 7)) == counts
    assert np.count_nonzero(orientation_table(rule, (5, 6))) == counts[1] + counts[2]


def test_the_literal_rule_favours_one_diagonal():
    codes = set(angles_of(orientation_table("literal", (5,))))
    assert {turned_code(code) for code in codes} != codes
