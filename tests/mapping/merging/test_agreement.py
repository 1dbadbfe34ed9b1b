"""Evidence of two overlaid maps for and against their transform."""

from dataclasses import replace

import numpy as np
import pytest
from drawn_maps import RESOLUTION, about_middle, apartment, blank, kept, moved, room

from lidarium.mapping.files.map_files import FREE
from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.grids.occupancy import UNKNOWN
from lidarium.mapping.merging.agreement import (
    MANY_WALLS,
    STRIDE,
    Agreement,
    Confirmation,
    ValidationSettings,
    WallField,
    _count_overlap,
    _distinct_walls,
    compare,
    count_walls,
    disc_agreement,
    why_refused,
)
from lidarium.mapping.merging.described_map import describe_map
from lidarium.mapping.merging.incremental import GrowingMap, IncrementalMerger


def test_the_score_of_a_map_with_itself_is_one():
    a = describe_map(apartment(), RESOLUTION)
    same = compare(a, a, Transform(), ValidationSettings())
    assert (same.score, same.hit_rate, same.contradicting_m) == (1.0, 1.0, 0.0)
    assert why_refused(same, ValidationSettings()) is None
    shifted = compare(a, a, Transform(0.5, 0.0, 0.0), ValidationSettings())
    assert shifted.score < 0.9
    assert "contradiction" in str(why_refused(shifted, ValidationSettings()))


def test_walls_at_the_rim_of_what_a_map_knows_do_not_contradict():
    unseen = apartment()
    unseen[8:10, 30:60] = 127
    a, b = describe_map(apartment(), RESOLUTION), describe_map(unseen, RESOLUTION)
    found = compare(a, b, Transform(0.0, -0.05, 0.0), ValidationSettings())
    assert found.contradicting_m == 0.0
    in_the_open = compare(a, b, Transform(0.0, -0.3, 0.0), ValidationSettings())
    assert in_the_open.contradicting_m > 1.0


def test_what_speaks_against_a_transform_weighs_more_than_what_speaks_for_it():
    settings = ValidationSettings()
    weak = Agreement(overlap_m2=6.0, agreeing_m=5.2, wall_m=6.0, across_m=1.3, contradicting_m=0.1, score=0.98)
    assert weak.evidence_m == pytest.approx(5.2 - 0.8 - 0.3)
    assert why_refused(weak, settings) is None
    assert "small overlap" in str(why_refused(replace(weak, wall_m=6.8), settings))
    assert "contradiction" in str(why_refused(replace(weak, contradicting_m=0.2), settings))


def test_corridors_and_halls_can_be_asked_for_more():
    settings = ValidationSettings(least_across_share=0.15, least_evidence_per_m2=0.3)
    room_like = Agreement(overlap_m2=20.0, agreeing_m=15.0, wall_m=15.5, across_m=6.0, score=1.0)
    assert why_refused(room_like, settings) is None
    assert "in one direction" in str(why_refused(replace(room_like, across_m=1.0), settings))
    assert "want 15" in str(why_refused(replace(room_like, overlap_m2=50.0), settings))
    assert why_refused(replace(room_like, across_m=1.0, overlap_m2=50.0), ValidationSettings()) is None


def test_what_drift_explains_is_excused_where_both_maps_know_a_building():
    furnished = Agreement(
        overlap_m2=150.0, agreeing_m=260.0, wall_m=265.0, across_m=120.0, contradicting_m=1.4, score=0.998
    )
    assert "contradiction" in str(why_refused(furnished, ValidationSettings()))
    assert why_refused(replace(furnished, overlap_m2=300.0), ValidationSettings()) is None


def test_the_overlap_and_its_middle_are_measured():
    a, b = (
        describe_map(np.full((60, 60), FREE, np.uint8), 0.1),
        describe_map(np.full((60, 60), FREE, np.uint8), 0.1),
    )
    found = compare(a, b, Transform(3.0, 0.0, 0.0), ValidationSettings())
    assert found.overlap_m2 == pytest.approx(18.0, rel=0.05)
    assert found.centre == pytest.approx((1.5, 3.0), abs=0.1)


def test_discs_count_cells_once_and_unknown_ones_too():
    a = describe_map(apartment(), RESOLUTION)
    points = a.corners.points
    assert disc_agreement(a, a, Transform(), points, 25) == 1.0
    assert disc_agreement(a, a, Transform(), np.concatenate([points, points]), 25) == 1.0
    assert disc_agreement(a, a, Transform(0.5, 0.0, 0.0), points, 25) < 0.9
    other = describe_map(kept(apartment(), slice(0, 60), slice(0, 80)), RESOLUTION)
    assert disc_agreement(other, a, Transform(), points, 25) < 0.9


def field_of(described):
    return WallField(described.levels, described.distance, described.is_open, 1.0 / RESOLUTION, 0.075, 0.175)


def test_walls_that_agree_miss_and_contradict_are_counted_apart():
    described = describe_map(room(blank(80, 100), 20, 20, 40, 60), RESOLUTION)
    walls = np.array([[2.0, 0.975], [2.0, 1.1], [2.0, 2.0], [2.0, 0.5], [-1.0, 2.0]])
    counts, facing = np.zeros(3, np.int64), np.zeros(3)
    count_walls(field_of(described), walls, np.tile((0.0, 1.0), (5, 1)), (0.0, 0.0, 0.0), counts, facing)
    # The fourth stands where nothing is known, the fifth outside of the map: neither is counted.
    assert counts.tolist() == [1, 1, 1]
    assert facing.tolist() == [0.0, 0.0, 1.0]


def test_the_other_side_of_a_thin_wall_does_not_agree():
    levels = room(blank(80, 100), 20, 20, 40, 60)
    counts, facing = np.zeros(3, np.int64), np.zeros(3)
    wall = np.array([[2.0, 0.975]])
    away = np.array([[0.0, -1.0]])
    count_walls(field_of(describe_map(levels, RESOLUTION)), wall, away, (0.0, 0.0, 0.0), counts, facing)
    assert counts.tolist() == [0, 1, 0]


@pytest.mark.parametrize("pose", [(0.0, 0.0, 0.0), (0.4, -0.3, 0.0), (1.0, 0.2, 0.7)])
def test_the_overlap_is_that_of_a_plain_count_of_every_third_cell(pose):
    generator = np.random.default_rng(4)
    a, b = (generator.choice(np.array([0, 127, 255], np.uint8), (30, 40)) for _ in range(2))
    found = np.zeros(3)
    _count_overlap(a, b, 0.1, pose, found)
    both = []
    for row in range(1, 30, STRIDE):
        for column in range(1, 40, STRIDE):
            centre = np.array([column + 0.5, row + 0.5]) * 0.1
            x, y = np.floor(Transform(*pose).apply(centre) / 0.1 + 1e-9).astype(int)
            if b[row, column] != UNKNOWN and 0 <= x < 40 and 0 <= y < 30 and a[y, x] != UNKNOWN:
                both.append(centre)
    assert found[0] == len(both) * STRIDE**2
    np.testing.assert_allclose(found[1:] / found[0], np.mean(both, axis=0))


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
    walls = _distinct_walls(one, one, Transform(), HIT_M)
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


def test_walls_are_counted_once_however_long_they_are():
    for length in (60, 120):
        levels = blank(160, 200)
        levels[18 : 22 + length, 18:102] = 0
        levels[20 : 20 + length, 20:100] = 255
        one = describe_map(levels, RESOLUTION)
        assert _distinct_walls(one, one, Transform(), HIT_M) == 4


def test_furniture_adds_walls_and_what_lies_elsewhere_none():
    one = describe_map(apartment(), RESOLUTION)
    assert _distinct_walls(one, one, Transform(), HIT_M) >= 20
    assert _distinct_walls(one, one, Transform(100.0, 0.0), HIT_M) == 0


def test_the_number_of_walls_does_not_depend_on_the_frame():
    truth = about_middle(0.5 * np.pi, apartment())
    one, turned = describe_map(apartment(), RESOLUTION), describe_map(moved(apartment(), truth), RESOLUTION)
    counts = (
        _distinct_walls(turned, one, truth, HIT_M),
        _distinct_walls(one, one, Transform(), HIT_M),
    )
    assert abs(counts[0] - counts[1]) <= 2
