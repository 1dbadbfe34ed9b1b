import math

import numpy as np
import pytest
from drawn_maps import RESOLUTION, about_middle, apartment, blank, kept, moved, noisy, room

from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.merging import pair
from lidarium.mapping.merging.agreement import Confirmation, ValidationSettings
from lidarium.mapping.merging.frame_tree import Edge, FrameTree
from lidarium.mapping.merging.incremental import GrowingMap, IncrementalMerger, _DescribedMaps
from lidarium.mapping.merging.pair import described, is_contradicted, verify_pair
from lidarium.mapping.merging.settings import MergeSettings, merge_settings

FIRST, SECOND = about_middle(0.4, apartment()), about_middle(-1.3, apartment())


def part(columns, pose, seed=0):
    return noisy(moved(kept(apartment(), slice(0, 180), columns), pose), seed)


def grown(levels, rows, columns, origin=(0.0, 0.0)):
    """The same map in a larger array, whose corner lies further out."""
    padded = np.pad(levels, ((rows, 0), (columns, 0)), constant_values=127)
    return GrowingMap(padded, (origin[0] - columns * RESOLUTION, origin[1] - rows * RESOLUTION))


def is_true(found, distance=0.1):
    apart, angle = found.difference(FIRST @ SECOND.inverse(), (8.0, 8.0))
    return apart < distance and angle < math.radians(1.0)


def test_maps_that_have_not_changed_are_neither_described_nor_compared_again():
    merger = IncrementalMerger(RESOLUTION)
    maps = {"a": GrowingMap(part(slice(0, 150), FIRST)), "b": GrowingMap(part(slice(60, 220), SECOND, 1))}
    first = merger.update(maps)
    assert (merger.searched, merger.verified) == (1, 0)
    again = merger.update({name: GrowingMap(one.levels.copy()) for name, one in maps.items()})
    assert (merger.searched, merger.verified) == (0, 0)
    assert again.pairs["a", "b"] is first.pairs["a", "b"]
    assert is_true(again.tree.lookup("a", "b"))


def test_a_verified_transform_is_not_searched_for_when_maps_grow_and_frames_stay():
    merger = IncrementalMerger(RESOLUTION)
    before = merger.update(
        {"b": GrowingMap(part(slice(60, 220), SECOND, 1)), "a": GrowingMap(part(slice(0, 150), FIRST))}
    )
    larger = grown(part(slice(0, 190), FIRST), 30, 41)
    after = merger.update({"b": GrowingMap(part(slice(60, 220), SECOND, 1)), "a": larger})
    assert (merger.searched, merger.verified) == (0, 1)
    assert after.pairs["b", "a"].found_by == "verification"
    assert after.groups() == [["b", "a"]]
    for merged in (before, after):
        assert is_true(merged.tree.lookup("a", "b"))
    fused = after.fused(["b", "a"])
    assert np.count_nonzero(fused.levels == 255) == pytest.approx(np.count_nonzero(apartment() == 255), rel=0.05)


def test_a_transform_that_grown_maps_contradict_is_given_up():
    merger = IncrementalMerger(RESOLUTION)
    maps = {"a": GrowingMap(part(slice(0, 150), FIRST)), "b": GrowingMap(part(slice(60, 220), SECOND, 1))}
    merger.update(maps)
    other = merger.update({**maps, "b": GrowingMap(room(blank(320, 320), 20, 20, 90, 130))})
    assert merger.searched == 1
    assert other.groups() == [["a"], ["b"]]


def test_a_refused_pair_is_searched_for_again_only_when_the_maps_know_more():
    merger = IncrementalMerger(RESOLUTION, search_growth_m2=5.0)
    maps = {"a": GrowingMap(part(slice(0, 50), FIRST)), "b": GrowingMap(part(slice(150, 220), SECOND, 1))}
    assert merger.update(maps).groups() == [["a"], ["b"]]
    merger.update({**maps, "a": GrowingMap(part(slice(0, 52), FIRST))})
    assert merger.searched == 0
    joined = merger.update({**maps, "a": GrowingMap(part(slice(0, 220), FIRST))})
    assert merger.searched == 1
    assert joined.groups() == [["a", "b"]]


def test_maps_that_are_missing_are_forgotten_and_pairs_that_may_not_be_tried_are_left_alone():
    merger = IncrementalMerger(RESOLUTION)
    maps = {"a": GrowingMap(part(slice(0, 150), FIRST)), "b": GrowingMap(part(slice(60, 220), SECOND, 1))}
    assert merger.update(maps, frozenset()).pairs == {}
    assert merger.searched == 0
    assert merger.update(maps).groups() == [["a", "b"]]
    assert merger.update({"a": maps["a"]}).groups() == [["a"]]
    with pytest.raises(ValueError, match="no maps"):
        merger.update({})


def test_a_pair_that_wants_confirmation_joins_when_grown_maps_are_found_to_lie_the_same_way():
    merger = IncrementalMerger(RESOLUTION, confirmation_growth_m2=2.0)
    maps = {"a": GrowingMap(part(slice(0, 150), FIRST)), "b": GrowingMap(part(slice(60, 220), SECOND, 1))}
    first = merger.update(maps)
    assert first.pairs["a", "b"].is_accepted
    assert first.groups() == [["a"], ["b"]]
    little = merger.update({**maps, "a": GrowingMap(part(slice(0, 151), FIRST))})
    assert (merger.searched, merger.verified) == (0, 1)
    assert little.groups() == [["a"], ["b"]]
    grown_maps = {**maps, "a": GrowingMap(part(slice(0, 170), FIRST))}
    confirmed = merger.update(grown_maps)
    assert (merger.searched, merger.verified) == (1, 0)
    assert confirmed.groups() == [["a", "b"]]
    merger.update({**grown_maps, "a": GrowingMap(part(slice(0, 190), FIRST))})
    assert (merger.searched, merger.verified) == (0, 1)
    contradicted = merger.update({**maps, "b": GrowingMap(room(blank(320, 320), 20, 20, 90, 130))})
    assert contradicted.groups() == [["a"], ["b"]]


def test_a_pair_waits_for_as_long_as_the_maps_do_not_convince():
    merger = IncrementalMerger(
        RESOLUTION,
        confirmation_growth_m2=2.0,
        confirmation=Confirmation(validation=ValidationSettings(least_evidence_m=40.0)),
    )
    maps = {"a": GrowingMap(part(slice(0, 120), FIRST)), "b": GrowingMap(part(slice(60, 220), SECOND, 1))}
    merger.update(maps)
    waiting = merger.update({**maps, "a": GrowingMap(part(slice(0, 150), FIRST))})
    assert waiting.pairs["a", "b"].is_accepted
    assert waiting.pairs["a", "b"].agreement.evidence_m < 40.0
    # What does not convince may be of the wrong place: another is searched for once the maps have grown.
    assert (merger.searched, merger.verified) == (1, 0)
    merger.update({**maps, "a": GrowingMap(part(slice(0, 151), FIRST))})
    assert (merger.searched, merger.verified) == (0, 1)
    assert waiting.groups() == [["a"], ["b"]]
    convinced = merger.update({**maps, "a": GrowingMap(part(slice(0, 220), FIRST))})
    assert convinced.pairs["a", "b"].agreement.evidence_m >= 40.0
    assert merger.searched == 1
    assert convinced.groups() == [["a", "b"]]
    assert is_true(convinced.tree.lookup("a", "b"))


def test_a_map_that_knows_nothing_of_its_own_joins_none_yet():
    """Both know one room of a few walls alone: nothing beyond it could have contradicted."""
    merger = IncrementalMerger(RESOLUTION, confirmation_growth_m2=0.0, confirmation=Confirmation(own_m2=6.0))
    levels = room(room(blank(200, 200), 60, 60, 60, 84), 100, 146, 40, 24)
    levels[100:120, 142:148] = 255
    maps = {name: GrowingMap(moved(levels, pose)) for name, pose in (("a", FIRST), ("b", SECOND))}
    merger.update(maps)
    again = merger.update({**maps, "b": GrowingMap(noisy(moved(levels, SECOND), 1))})
    assert again.pairs["a", "b"].is_accepted
    assert again.groups() == [["a"], ["b"]]
    maps = {"a": GrowingMap(part(slice(0, 160), FIRST)), "b": GrowingMap(part(slice(60, 180), SECOND, 1))}
    other = IncrementalMerger(RESOLUTION, confirmation_growth_m2=0.0, confirmation=Confirmation(own_m2=6.0))
    other.update(maps)
    assert other.update({**maps, "b": GrowingMap(part(slice(60, 220), SECOND, 1))}).groups() == [["a", "b"]]


def test_a_pair_that_is_found_elsewhere_the_second_time_is_not_confirmed():
    merger = IncrementalMerger(RESOLUTION, confirmation_growth_m2=2.0)
    merger.update({"a": GrowingMap(part(slice(0, 150), FIRST)), "b": GrowingMap(part(slice(60, 220), SECOND, 1))})
    # The second robot's frame has jumped by half a metre: what was found before is gone, and the new place
    # waits in its turn.
    jumped = GrowingMap(part(slice(60, 220), SECOND, 1), (0.5, 0.0))
    moved_frame = merger.update({"a": GrowingMap(part(slice(0, 170), FIRST)), "b": jumped})
    assert moved_frame.pairs["a", "b"].is_accepted
    assert moved_frame.groups() == [["a"], ["b"]]
    assert merger.update({"a": GrowingMap(part(slice(0, 190), FIRST)), "b": jumped}).groups() == [["a", "b"]]


def test_verification_refines_a_transform_or_says_why_not():
    settings = merge_settings()
    a, b = (
        described(levels, RESOLUTION, settings)
        for levels in (part(slice(0, 150), FIRST), part(slice(60, 220), SECOND, 1))
    )
    true = FIRST @ SECOND.inverse()
    near = Transform(true.x + 0.05, true.y - 0.05, true.theta)
    result = verify_pair(a, b, near, settings)
    assert result.is_accepted
    assert is_true(result.a_from_b, 0.05)
    assert not verify_pair(a, b, Transform(true.x + 1.0, true.y, true.theta), settings).is_accepted


def test_maps_joined_through_a_third_must_not_contradict_each_other():
    settings = merge_settings()
    features = {
        "west": described(part(slice(0, 150), FIRST), RESOLUTION, settings),
        "east": described(part(slice(60, 220), SECOND, 1), RESOLUTION, settings),
    }
    true = FIRST @ SECOND.inverse()

    def contradicts(a, b, a_from_b):
        return is_contradicted(features[a], features[b], a_from_b, settings)

    for shift, weakest in ((0.0, None), (1.5, "b")):
        tree = FrameTree()
        # Through a map in between, whose overlap with both is not in question here.
        edges = [
            Edge("west", "between", Transform(), 9.0),
            Edge("between", "east", Transform(true.x + shift, true.y, true.theta), 3.0),
        ]
        tree.set_edges(edges, contradicts)
        assert [edge.weight for edge in tree.dropped] == ([] if weakest is None else [3.0])
        assert (tree.lookup("west", "east") is None) == (weakest is not None)


def test_edges_can_be_replaced_while_the_world_stays():
    tree = FrameTree()
    for name in "abc":
        tree.add_map(name)
    tree.set_edges([Edge("c", "b", Transform(1.0, 0.0, 0.0), 2.0)])
    root = tree.groups()[0][0]
    tree.set_edges([])
    tree.set_edges([Edge("a", "b", Transform(), 9.0), Edge("b", "c", Transform(), 1.0)])
    assert tree.groups()[0][0] == root
    tree.remove_map(root)
    assert all(root not in group for group in tree.groups())


def test_few_pairs_are_searched_for_in_turn_and_those_that_others_join_are_verified_alone():
    merger = IncrementalMerger(RESOLUTION, searches_per_update=1)
    maps = {
        "a": GrowingMap(part(slice(0, 150), FIRST)),
        "b": GrowingMap(part(slice(60, 220), SECOND, 1)),
        "c": GrowingMap(part(slice(30, 180), SECOND, 2)),
    }
    groups = []
    for _ in range(4):
        groups.append(merger.update(maps).groups())
        assert merger.searched <= 1
    assert groups[0] == [["a", "b"], ["c"]]
    assert groups[1] == groups[3] == [["a", "b", "c"]]
    last = merger.update(maps)
    assert len(last.pairs) == 3
    assert sum(result.found_by == "verification" for result in last.pairs.values()) == 1


def test_a_pair_that_is_left_alone_stays_in_place_while_a_map_grows_beyond_its_corner():
    merger = IncrementalMerger(RESOLUTION)
    maps = {"a": GrowingMap(part(slice(0, 150), FIRST)), "b": GrowingMap(part(slice(60, 220), SECOND, 1))}
    before = merger.update(maps).tree.lookup("a", "b")
    larger = {"a": grown(maps["a"].levels, 30, 41), "b": grown(maps["b"].levels, 7, 0)}
    after = merger.update(larger, frozenset())
    assert (merger.searched, merger.verified) == (0, 0)
    distance, angle = after.tree.lookup("a", "b").difference(before, (8.0, 8.0))
    assert distance < 1e-9
    assert angle < 1e-9


def test_maps_that_agree_as_others_imply_are_not_contradicted_wherever_they_would_slide(monkeypatch):
    """Two parts of a corridor: walls hold it in one direction, so that it may settle where it was not."""
    levels = room(blank(60, 320), 20, 10, 20, 300)
    settings = merge_settings()
    first = described(kept(levels, slice(0, 60), slice(0, 230)), RESOLUTION, settings)
    second = described(kept(levels, slice(0, 60), slice(90, 320)), RESOLUTION, settings)
    across = Transform(0.0, 0.4, 0.0)
    assert is_contradicted(first, second, across, settings)
    assert not is_contradicted(first, second, Transform(0.0, 0.1, 0.0), settings)
    monkeypatch.setattr(pair, "refine_on_walls", lambda *_: across)
    assert not is_contradicted(first, second, Transform(), settings)
    assert is_contradicted(first, second, across, settings)


SETTINGS = MergeSettings()


def taken_in(maps, number, into=None):
    into = into or _DescribedMaps()
    into.update(maps, RESOLUTION, SETTINGS, number)
    return into


def test_only_what_has_changed_is_described_again():
    known = taken_in({"a": GrowingMap(apartment()), "b": GrowingMap(kept(apartment(), slice(0, 80), slice(0, 90)))}, 1)
    before = dict(known.features)
    taken_in({"a": GrowingMap(apartment()), "b": GrowingMap(apartment())}, 2, known)
    assert known.features["a"] is before["a"]
    assert known.features["b"] is not before["b"]
    assert known.changed_at == {"a": 1, "b": 2}


def test_a_map_whose_corner_has_moved_has_changed():
    known = taken_in({"a": GrowingMap(apartment())}, 1)
    taken_in({"a": GrowingMap(apartment(), (0.0, RESOLUTION))}, 2, known)
    assert known.changed_at == {"a": 2}
    assert known.maps["a"].origin == (0.0, RESOLUTION)


def test_the_known_area_counts_all_cells_but_unknown_ones():
    levels = np.full((10, 20), 127, np.uint8)
    levels[:5, :10], levels[5, :4] = 255, 0
    known = taken_in({"a": GrowingMap(levels)}, 1)
    assert known.known_m2["a"] == pytest.approx(54 * RESOLUTION**2)


def test_a_map_that_is_missing_is_forgotten():
    known = taken_in({"a": GrowingMap(apartment()), "b": GrowingMap(apartment())}, 1)
    taken_in({"b": GrowingMap(apartment())}, 2, known)
    assert list(known.features) == list(known.maps) == ["b"]
    taken_in({"a": GrowingMap(apartment()), "b": GrowingMap(apartment())}, 3, known)
    assert known.changed_at == {"a": 3, "b": 1}


def test_what_is_no_map_is_refused_and_what_was_known_is_kept():
    known = taken_in({"a": GrowingMap(apartment())}, 1)
    features, area = known.features["a"], known.known_m2["a"]
    with pytest.raises(ValueError, match="shape"):
        taken_in({"a": GrowingMap(np.zeros((0, 4), np.uint8)), "b": GrowingMap(apartment())}, 2, known)
    assert known.features == {"a": features}
    assert (known.known_m2, known.changed_at) == ({"a": area}, {"a": 1})
    assert np.array_equal(known.maps["a"].levels, apartment())
