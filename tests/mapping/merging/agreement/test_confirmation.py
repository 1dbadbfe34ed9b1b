"""What convinces beside being found: as many distinct walls as their length wants."""

from dataclasses import replace

import pytest
from drawn_maps import RESOLUTION, apartment, blank

from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.merging.agreement.confirmation import MANY_WALLS, Confirmation
from lidarium.mapping.merging.agreement.distinct_walls import distinct_walls
from lidarium.mapping.merging.agreement.validation import Agreement, ValidationSettings, compare
from lidarium.mapping.merging.description.described_map import describe_map
from lidarium.mapping.merging.growing_maps import GrowingMap
from lidarium.mapping.merging.incremental import IncrementalMerger

HIT_M = 0.075


def corridor_corner(alcove):
    """A corner of a corridor 3.5 m wide with two arms of 9 m, and an alcove at the end of one of them."""
    levels = blank(260, 260)
    levels[18:202, 18:202] = 0
    levels[92:202, 92:202] = 127
    levels[20:90, 20:200] = 255
    levels[20:200, 20:90] = 255
    levels[(slice(170, 190), slice(4, 20)) if alcove else (slice(4, 20), slice(170, 190))] = 255
    return levels


def test_two_corners_of_corridors_agree_and_do_not_convince():
    """They share 25 m of wall in a few walls, and no map knows the arm that would contradict it."""
    a = describe_map(corridor_corner(0)[:, :140], RESOLUTION)
    b = describe_map(corridor_corner(1)[:140], RESOLUTION)
    agreement = compare(a, b, Transform(), ValidationSettings())
    assert agreement.evidence_m > 15.0
    known_m2 = 60.0
    assert Confirmation(own_m2=6.0).convinces((a, b), known_m2, Transform(), agreement)
    small = replace(agreement, overlap_m2=40.0)
    assert not Confirmation(own_m2=6.0, wall_m=3.5).convinces((a, b), known_m2, Transform(), small)


def test_many_walls_convince_though_maps_know_nothing_else_and_excuse_a_body():
    one = describe_map(apartment(), RESOLUTION)
    found = Agreement(20.0, (4.0, 4.0), 40.0, 41.0, 12.0, 0.0, 1.0)
    rule = Confirmation(validation=ValidationSettings(most_contradiction_m=0.3), own_m2=6.0, wall_m=3.5)
    walls = distinct_walls(one, one, Transform(), HIT_M)
    assert walls > MANY_WALLS
    assert rule.convinces((one, one), 20.0, Transform(), found)
    body = replace(found, contradicting_m=0.3 + 0.09 * (walls - MANY_WALLS))
    assert rule.convinces((one, one), 20.0, Transform(), body)
    assert not rule.convinces((one, one), 20.0, Transform(), replace(found, contradicting_m=3.0))
    assert not rule.convinces((one, one), 20.0, None, found)


@pytest.mark.parametrize("wall_m", [0.0, 3.5])
def test_a_pair_that_does_not_convince_is_searched_for_again_as_maps_grow(wall_m):
    merger = IncrementalMerger(
        RESOLUTION, confirmation_growth_m2=2.0, confirmation=Confirmation(own_m2=1e6, wall_m=wall_m)
    )
    levels = corridor_corner(0)
    for columns, searched in ((120, 1), (121, 0), (160, 1)):
        part = levels.copy()
        part[:, columns:] = 127
        merger.update({"a": GrowingMap(part), "b": GrowingMap(levels)})
        assert merger.searched == searched
