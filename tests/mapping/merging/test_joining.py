"""The frame tree of maps, made of the pairs that were accepted."""

import numpy as np
import pytest
from drawn_maps import RESOLUTION, apartment, blank, bowed, kept

from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.grids.occupancy import UNKNOWN
from lidarium.mapping.merging.agreement import Agreement
from lidarium.mapping.merging.bend.hypotheses import ranked_hypotheses
from lidarium.mapping.merging.described_map import describe_map
from lidarium.mapping.merging.frame_tree import Edge, FrameTree
from lidarium.mapping.merging.joining import Merged, joined_tree, pair_edge, placed
from lidarium.mapping.merging.pair import PairResult
from lidarium.mapping.merging.settings import MergeSettings

SETTINGS = MergeSettings()


def accepted(a_from_b, evidence_m=10.0, centre=(5.0, 4.0)):
    agreement = Agreement(overlap_m2=40.0, centre=centre, agreeing_m=evidence_m, wall_m=evidence_m)
    return PairResult(True, "accepted", a_from_b, agreement=agreement)


@pytest.fixture(scope="module")
def features():
    """Three maps of which the last two know nothing that could contradict."""
    empty = describe_map(blank(), RESOLUTION)
    return {"a": describe_map(apartment(), RESOLUTION), "b": empty, "c": empty}


def test_accepted_pairs_alone_join_maps(features):
    refused = PairResult(False, "small overlap", Transform(9.0, 9.0, 1.0))
    tree = joined_tree(features, {("a", "b"): accepted(Transform(1.0, 2.0, 0.3)), ("b", "c"): refused}, SETTINGS)
    assert tree.groups() == [["a", "b"], ["c"]]
    assert tree.lookup("a", "b").difference(Transform(1.0, 2.0, 0.3)) == pytest.approx((0.0, 0.0))
    assert tree.lookup("a", "c") is None


def test_transforms_of_corners_become_those_of_frames(features):
    origins = {"a": (-1.0, 2.0), "b": (4.0, 0.5)}
    corners = Transform(0.6, 0.2, 0.5)
    tree = joined_tree(features, {("a", "b"): accepted(corners)}, SETTINGS, origins)
    # A point 1 m right of b's corner, by either way into a's frame.
    by_corners = corners.apply((1.0, 0.0)) + np.array((-1.0, 2.0))
    assert tree.lookup("a", "b").apply((5.0, 0.5)) == pytest.approx(by_corners)
    (edge,) = tree.edges
    assert edge.centre == pytest.approx((9.0, 4.5))


def test_a_pair_that_contradicts_two_stronger_ones_is_dropped(features):
    pairs = {
        ("a", "b"): accepted(Transform(1.0, 0.0, 0.0), 20.0),
        ("b", "c"): accepted(Transform(1.0, 0.0, 0.0), 15.0),
        ("a", "c"): accepted(Transform(3.0, 0.0, 0.0), 5.0),
    }
    tree = joined_tree(features, pairs, SETTINGS)
    assert [(edge.a, edge.b) for edge in tree.dropped] == [("a", "c")]
    assert tree.lookup("a", "c").x == pytest.approx(2.0)


def test_maps_that_others_join_may_not_contradict_each_other(features):
    known = {**features, "c": features["a"]}
    for shift, is_joined in ((0.0, True), (1.5, False)):
        pairs = {
            ("a", "b"): accepted(Transform(), 20.0),
            ("b", "c"): accepted(Transform(shift, 0.0, 0.0), 5.0),
        }
        tree = joined_tree(known, pairs, SETTINGS)
        assert (tree.lookup("a", "c") is not None) is is_joined
        assert [(edge.a, edge.b) for edge in tree.dropped] == ([] if is_joined else [("b", "c")])


def test_an_earlier_tree_keeps_its_world_and_forgets_maps_that_are_gone(features):
    tree = joined_tree(features, {("b", "c"): accepted(Transform(1.0, 0.0, 0.0))}, SETTINGS)
    root = tree.groups()[0][0]
    pairs = {("a", "b"): accepted(Transform(), 30.0), ("b", "c"): accepted(Transform(1.0, 0.0, 0.0))}
    again = joined_tree(features, pairs, SETTINGS, tree=tree)
    assert again is tree
    assert again.groups()[0][0] == root
    left = joined_tree({"a": features["a"], "c": features["c"]}, {}, SETTINGS, tree=tree)
    assert sorted(left.names) == ["a", "c"]


def test_bent_pairs_may_miss_each_other_by_their_bend():
    a, b = (describe_map(levels, RESOLUTION) for levels in (apartment(), bowed(apartment(), 0.3)))
    best = ranked_hypotheses(a, b, [Transform()], SETTINGS.bend)[0]
    bent = PairResult(True, "accepted", Transform(), found_by="bend", ranked=(best,))
    edge = pair_edge("a", "b", bent, Transform(), (1.0, 2.0))
    assert edge.slack_m == pytest.approx(2.0 * best.bend.bend_m)
    assert edge.slack_m > 0.05
    assert edge.weight == best.evidence_m
    assert pair_edge("a", "b", accepted(Transform(), 7.0), Transform(), (1.0, 2.0)).slack_m == 0.0


def merged_of(levels, origins=None):
    """West and east joined where they belong, and a map that joins none."""
    tree = FrameTree()
    for name in levels:
        tree.add_map(name)
    frames = {name: placed((origins or {}).get(name, (0.0, 0.0))) for name in levels}
    tree.set_edges([Edge("west", "east", frames["west"] @ frames["east"].inverse(), 9.0)])
    return Merged(levels, RESOLUTION, {}, tree, origins or {})


def halves():
    whole = apartment()
    return {
        "west": kept(whole, slice(0, 180), slice(0, 120)),
        "east": kept(whole, slice(0, 180), slice(100, 220)),
        "alone": whole,
    }


@pytest.mark.parametrize("origins", [None, {"west": (-2.0, 1.0), "east": (3.5, 0.5)}])
def test_two_halves_are_fused_into_the_whole(origins):
    merged = merged_of(halves(), origins)
    assert merged.groups() == [["west", "east"], ["alone"]]
    fused = merged.fused(["west", "east"])
    x, y = (origins or {"west": (0.0, 0.0)})["west"]
    rows, columns = np.nonzero(apartment() != UNKNOWN)
    there = (
        rows + round((y - fused.origin[1]) / RESOLUTION),
        columns + round((x - fused.origin[0]) / RESOLUTION),
    )
    np.testing.assert_array_equal(fused.levels[there], apartment()[rows, columns])
    in_west, in_east = columns < 120, columns >= 100
    np.testing.assert_array_equal(fused.sources[there], in_west * np.uint64(1) + in_east * np.uint64(2))


def test_maps_that_are_not_joined_cannot_be_fused_or_deformed():
    merged = merged_of(halves())
    for attempt in (merged.fused, merged.deformed):
        with pytest.raises(ValueError, match="map 'alone' is not joined with 'west'"):
            attempt(["west", "alone"])


def test_a_group_is_deformed_onto_its_first_map():
    levels = halves() | {"west": apartment(), "east": bowed(apartment(), 0.25)}
    merged = merged_of(levels)
    deformed = merged.deformed(["west", "east"])
    rigid = merged.fused(["west", "east"])
    walls = apartment() == 0
    counts = [int(np.count_nonzero(one.levels == 0)) - int(np.count_nonzero(walls)) for one in (deformed.fused, rigid)]
    assert counts[0] < 0.5 * counts[1]


def test_a_corner_is_placed_in_its_frame_without_rotation():
    assert placed((1.5, -2.0)) == Transform(1.5, -2.0, 0.0)
