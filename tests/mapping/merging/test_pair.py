import math
from dataclasses import replace

import numpy as np
import pytest
from drawn_maps import RESOLUTION, about_middle, apartment, blank, bowed, hall, kept, moved, noisy, room
from hypothesis import given, settings
from hypothesis import strategies as st

from lidarium.mapping.files.map_files import FREE, OCCUPIED, UNKNOWN
from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.merging.candidates import bendable
from lidarium.mapping.merging.described_map import describe_map
from lidarium.mapping.merging.pair import PairResult, _exact_motion, _or_bent, described, explained, merge_pair
from lidarium.mapping.merging.settings import TOLERANCES, MergeSettings, merge_settings


def merged(a, b, resolution=RESOLUTION, mode="default", tolerance=None):
    chosen = merge_settings(mode, resolution)
    if tolerance is not None:
        chosen = replace(chosen, confidence=TOLERANCES[tolerance])
    return merge_pair(described(a, resolution, chosen), described(b, resolution, chosen), chosen)


def is_right(result, truth, at, distance=0.1, degrees=1.0):
    assert result.a_from_b is not None
    error, angle = result.a_from_b.difference(truth, at)
    return error <= distance and angle <= math.radians(degrees)


@settings(max_examples=8)
@given(st.floats(-math.pi, math.pi), st.tuples(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0)), st.integers(0, 99))
def test_a_turned_shifted_and_noisy_map_is_joined_where_it_belongs(theta, shift, seed):
    truth = about_middle(theta, apartment(), shift=shift)
    result = merged(noisy(moved(apartment(), truth), seed), noisy(apartment(), seed + 1))
    assert result.is_accepted, result.reason
    assert is_right(result, truth, (5.0, 4.0))


@settings(max_examples=4)
@given(st.integers(0, 40), st.integers(0, 40))
def test_margins_of_unknown_cells_change_nothing_but_the_translation(rows, columns):
    plain = merged(moved(apartment(), about_middle(0.6, apartment())), apartment())
    padded = np.pad(apartment(), ((rows, 7), (columns, 5)), constant_values=UNKNOWN)
    result = merged(moved(apartment(), about_middle(0.6, apartment())), padded)
    assert plain.is_accepted
    assert result.is_accepted
    assert plain.a_from_b is not None
    assert is_right(
        result, plain.a_from_b @ Transform(-columns * RESOLUTION, -rows * RESOLUTION), (5.0, 4.0), 0.03, 0.3
    )


def test_the_order_of_the_maps_turns_the_transform_round():
    a, b = kept(moved(apartment(), about_middle(1.1, apartment())), slice(0, 320), slice(0, 220)), apartment()
    forth, back = merged(a, b), merged(b, a)
    assert forth.is_accepted
    assert back.is_accepted
    assert back.a_from_b is not None
    assert is_right(forth, back.a_from_b.inverse(), (5.0, 4.0), 0.05, 0.5)


def test_parts_that_share_some_rooms_are_joined():
    a, b = kept(apartment(), slice(0, 180), slice(0, 150)), kept(apartment(), slice(0, 180), slice(58, 220))
    truth = about_middle(2.5, apartment())
    result = merged(moved(a, truth), b)
    assert result.is_accepted, result.reason
    assert is_right(result, truth, (4.0, 4.0))


@pytest.mark.parametrize("method", ["distances", "triplets", "radius"])
def test_the_other_methods_of_matching_never_join_wrongly(method):
    chosen = merge_settings()
    chosen = replace(chosen, correspondence=replace(chosen.correspondence, method=method))
    truth = about_middle(0.5, apartment())
    a, b = (
        described(moved(apartment(), truth), RESOLUTION, chosen),
        described(apartment(), RESOLUTION, chosen),
    )
    result = merge_pair(a, b, chosen)
    assert result.is_accepted
    assert is_right(result, truth, (5.0, 4.0))


def test_without_corners_walls_alone_join_maps():
    chosen = merge_settings()
    chosen = replace(chosen, correspondence=replace(chosen.correspondence, threshold=1.0))
    truth = about_middle(-0.8, apartment())
    result = merge_pair(
        described(moved(apartment(), truth), RESOLUTION, chosen),
        described(apartment(), RESOLUTION, chosen),
        chosen,
    )
    assert result.found_by == "correlation"
    assert result.is_accepted, result.reason
    assert is_right(result, truth, (5.0, 4.0))


def test_the_same_maps_give_the_same_result():
    a, b = noisy(moved(apartment(), about_middle(0.3, apartment())), 5), apartment()
    assert merged(a, b).a_from_b == merged(a, b).a_from_b


def office():
    """Another building."""
    levels = blank(180, 220)
    room(levels, 20, 10, 30, 190)
    for column, width, depth in ((10, 40, 55), (53, 60, 50), (116, 30, 60), (149, 51, 45)):
        room(levels, 53, column, depth, width)
        levels[49:54, column + 12 : column + 30] = FREE
    levels[70:80, 70:90] = OCCUPIED
    return levels


def test_unrelated_buildings_are_refused():
    result = merged(apartment(), office())
    assert not result.is_accepted
    assert result.reason != "accepted"


def test_a_mirrored_map_is_refused():
    assert not merged(apartment(), np.ascontiguousarray(apartment()[:, ::-1])).is_accepted


def test_a_square_room_is_ambiguous():
    square = room(blank(160, 160), 30, 30, 100, 100)
    result = merged(square, moved(square, about_middle(0.2, square)))
    assert not result.is_accepted
    assert result.reason.startswith("ambiguous")


def test_a_straight_corridor_is_ambiguous():
    corridor = blank(60, 300)
    corridor[20:40, 10:290] = FREE
    corridor[18:20, 10:290] = corridor[40:42, 10:290] = OCCUPIED
    result = merged(corridor, kept(corridor, slice(0, 60), slice(50, 250)))
    assert not result.is_accepted
    assert "ambiguous" in result.reason


def test_a_room_that_differs_by_a_metre_of_wall_is_refused_where_maps_may_not_differ():
    changed = apartment()
    changed[110:115, 83:105] = OCCUPIED
    result = merged(moved(apartment(), about_middle(0.9, apartment())), changed, tolerance="strict")
    assert not result.is_accepted
    assert "contradiction" in result.reason


def test_a_door_that_was_moved_is_refused_where_maps_may_not_differ():
    changed = apartment()
    changed[55:58, 110:128], changed[55:58, 86:104] = OCCUPIED, FREE
    result = merged(moved(apartment(), about_middle(0.9, apartment())), changed, tolerance="strict")
    assert not result.is_accepted
    assert "contradiction" in result.reason


def test_moved_furniture_leaves_an_apartment_the_same_place():
    changed = apartment()
    changed[110:115, 83:105] = OCCUPIED
    changed[38:46, 150:170], changed[20:28, 150:170] = FREE, OCCUPIED
    truth = about_middle(0.9, apartment())
    result = merged(moved(apartment(), truth), changed)
    assert result.is_accepted, result.reason
    assert result.found_by == "bend"
    assert result.confidence > TOLERANCES["normal"]
    assert is_right(result, truth, (5.0, 4.0))


def test_rooms_of_one_plan_with_other_furniture_are_refused():
    levels = blank(140, 160)
    room(levels, 20, 20, 76, 68)
    one, other = levels.copy(), levels.copy()
    for grid, boxes in (
        (one, ((20, 20, 40, 38), (76, 70, 96, 88))),
        (other, ((20, 20, 40, 38), (76, 70, 96, 88), (50, 20, 60, 48))),
    ):
        for box in boxes:
            grid[box[0] : box[2], box[1] : box[3]] = OCCUPIED
    for tolerance in TOLERANCES:
        assert not merged(moved(one, about_middle(0.4, one)), other, tolerance=tolerance).is_accepted


@pytest.mark.parametrize("mode", ["default", "thesis"])
@pytest.mark.parametrize(
    "levels",
    [
        blank(),
        np.full((1, 1), FREE, np.uint8),
        np.full((1, 1), OCCUPIED, np.uint8),
        np.full((40, 40), FREE, np.uint8),
    ],
)
def test_a_map_without_features_is_refused_with_a_reason(levels, mode):
    for a, b in ((levels, apartment()), (apartment(), levels), (levels, levels)):
        result = merged(a, b, mode=mode)
        assert not result.is_accepted
        assert "too few" in result.reason


def test_rooms_that_look_alike_are_refused_where_the_building_has_changed():
    """Moved by a room, one room lies on another and nothing contradicts; but much more speaks for the
    place that is contradicted."""

    def building():
        levels = blank(140, 300)
        for first in (10, 82, 154, 226):
            room(levels, 10, first, 90, 66)
            levels[10:22, first : first + 14] = OCCUPIED
            levels[70:82, first + 50 : first + 66] = OCCUPIED
        levels[40:56, 76:226] = np.where(levels[40:56, 76:226] == OCCUPIED, FREE, levels[40:56, 76:226])
        return levels

    changed = building()
    for first in (10, 82, 154):
        changed[50:62, first + 20 : first + 36] = OCCUPIED
    result = merged(building(), changed)
    assert not result.is_accepted
    assert "contradiction" in result.reason or "ambiguous" in result.reason


def test_the_thesis_joins_an_easy_pair_and_not_two_buildings():
    truth = about_middle(math.pi / 2.0, apartment())
    result = merged(moved(apartment(), truth), apartment(), mode="thesis")
    assert result.is_accepted, result.reason
    assert is_right(result, truth, (5.0, 4.0), 0.3, 3.0)
    assert not merged(apartment(), office(), mode="thesis").is_accepted


def test_maps_of_two_resolutions_are_no_pair():
    with pytest.raises(ValueError, match="resolution"):
        merge_pair(describe_map(apartment(), 0.05), describe_map(apartment(), 0.1))


@pytest.mark.parametrize("quarters", [0, 1, 2, 3])
def test_a_turned_copy_is_laid_on_its_cells_exactly(quarters):
    levels = apartment()
    # Counter-clockwise with row 0 below.
    turned = np.ascontiguousarray(np.rot90(levels, -quarters))
    rows, columns = levels.shape
    corner = ((0.0, 0.0), (rows, 0.0), (columns, rows), (0.0, columns))[quarters]
    truth = Transform(
        corner[0] * RESOLUTION, corner[1] * RESOLUTION, math.remainder(quarters * math.pi / 2.0, math.tau)
    )
    start = Transform(truth.x + 0.12, truth.y - 0.08, truth.theta + math.radians(0.5))
    found = _exact_motion(describe_map(turned, RESOLUTION), describe_map(levels, RESOLUTION), start)
    assert found is not None
    assert (found.x, found.y) == pytest.approx((truth.x, truth.y), abs=1e-12)
    assert math.cos(found.theta - truth.theta) == pytest.approx(1.0, abs=1e-12)


def test_a_rotation_that_is_no_quarter_turn_has_no_exact_motion():
    one = describe_map(apartment(), RESOLUTION)
    assert _exact_motion(one, one, Transform(theta=math.radians(3.0))) is None


def test_maps_that_do_not_share_their_cells_have_no_exact_motion():
    truth = about_middle(0.02, apartment())
    other = describe_map(moved(apartment(), truth), RESOLUTION)
    assert _exact_motion(other, describe_map(apartment(), RESOLUTION), truth) is None
    one = describe_map(apartment(), RESOLUTION)
    assert _exact_motion(one, one, Transform(2.0, 0.0, 0.0)) is None


def test_maps_that_know_nothing_in_common_have_no_exact_motion():
    one = describe_map(apartment(), RESOLUTION)
    assert _exact_motion(one, one, Transform(100.0, 0.0, 0.0)) is None
    assert _exact_motion(one, describe_map(blank(), RESOLUTION), Transform()) is None
    assert _exact_motion(describe_map(blank(), RESOLUTION), one, Transform()) is None


def test_walls_that_only_one_map_knows_do_not_count():
    part = apartment()
    part[:, 110:] = 127
    a, b = describe_map(part, RESOLUTION), describe_map(apartment(), RESOLUTION)
    assert _exact_motion(a, b, Transform(0.05, 0.0, 0.0)) == Transform()


SETTINGS = MergeSettings()
REFUSED = PairResult(False, "contradiction", Transform(0.05, 0.05, 0.0), tried=(Transform(3.0, 1.0, 0.4),))


@pytest.fixture(scope="module")
def maps():
    """A hall, and the same as drift has bent it."""
    return describe_map(hall(), RESOLUTION), describe_map(bowed(hall(), 0.3), RESOLUTION)


def test_what_was_tried_is_ranked_with_the_best_first(maps):
    known = explained(*maps, REFUSED, SETTINGS)
    assert len(known.ranked) == 2
    evidence = [one.evidence_m for one in known.ranked]
    assert evidence == sorted(evidence, reverse=True)
    assert abs(known.ranked[0].bend.a_from_b.theta) < 0.05
    assert known.confidence > 0.9
    assert (known.is_accepted, known.a_from_b) == (False, REFUSED.a_from_b)
    assert explained(*maps, known, SETTINGS) is known


def test_a_refused_pair_is_told_as_its_best_hypothesis(maps):
    """Pose, agreement, reason and confidence are of one hypothesis, whichever transform was refused at first."""
    elsewhere = replace(REFUSED, a_from_b=Transform(3.0, 1.0, 0.4), inliers=5, tried=(Transform(0.05, 0.05, 0.0),))
    known = explained(*maps, elsewhere, replace(SETTINGS, confidence=2.0))
    assert known.ranked[0].bend.a_from_b.difference(Transform(), (5.0, 4.0))[0] < 0.3
    assert (known.is_accepted, known.a_from_b) == (False, known.ranked[0].bend.a_from_b)
    assert known.agreement is known.ranked[0].agreement
    assert (known.score, known.inliers) == (known.agreement.score, 0)
    assert known.reason == "contradiction: the maps agree only once they are bent"


def test_bent_maps_are_found_by_a_coarse_search():
    truth = about_middle(2.1, hall())
    a, b = describe_map(moved(hall(), truth), RESOLUTION), describe_map(bowed(hall(), 0.5), RESOLUTION)
    found = bendable(a, b, SETTINGS)
    assert len(found) == SETTINGS.bend.proposals
    distance, angle = found[0].difference(truth, b.walls.mean(axis=0))
    assert distance < 0.6
    assert angle < math.radians(3.0)
    assert bendable(a, b, replace(SETTINGS, bend=replace(SETTINGS.bend, proposals=1))) == found[:1]


def test_maps_without_walls_are_explained_by_nothing(maps):
    none = describe_map(blank(), RESOLUTION)
    assert explained(maps[0], none, REFUSED, SETTINGS) is REFUSED
    assert explained(none, maps[0], REFUSED, SETTINGS) is REFUSED
    without = explained(*maps, PairResult(False, "too few corners"), SETTINGS)
    assert (without.ranked, without.confidence) == ((), 0.0)


def test_a_refused_pair_is_accepted_where_it_agrees_bent(maps):
    found = _or_bent(*maps, replace(REFUSED, inliers=7), SETTINGS)
    assert (found.is_accepted, found.reason, found.found_by) == (True, "accepted", "bend")
    assert found.inliers == 0
    assert found.a_from_b == found.ranked[0].bend.a_from_b
    assert found.agreement is found.ranked[0].agreement
    assert found.score == found.agreement.score


def test_what_is_not_believed_stays_refused(maps):
    assert _or_bent(*maps, replace(REFUSED, is_accepted=True), SETTINGS).found_by == "corners"
    for changed in (
        replace(SETTINGS, confidence=2.0),
        replace(SETTINGS, bend=replace(SETTINGS.bend, candidates=0)),
    ):
        assert _or_bent(*maps, REFUSED, changed) is REFUSED
    other = describe_map(apartment(), RESOLUTION)
    unsure = _or_bent(maps[0], other, replace(REFUSED, a_from_b=Transform(1.0, 2.0, 0.7), tried=()), SETTINGS)
    assert not unsure.is_accepted
    assert unsure.reason == "contradiction"
    assert unsure.confidence < SETTINGS.confidence
