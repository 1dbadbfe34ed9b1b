import itertools
import json
import math

import numpy as np
import pytest
from drawn_maps import RESOLUTION, about_middle, apartment, kept, moved, noisy, room, blank
from hypothesis import given, settings
from hypothesis import strategies as st

import lidarium
from lidarium.envs.exploration import ExplorationEnv
from lidarium.envs.settings import make_settings
from lidarium.evaluation.runner import run_episode
from lidarium.mapping.map_files import FREE, OCCUPIED, UNKNOWN, read_grey_map
from lidarium.mapping.merging.frame_tree import Edge, FrameTree
from lidarium.mapping.merging.fusion import fuse
from lidarium.mapping.merging.merger import merge_maps
from lidarium.mapping.merging.pair import described, merge_pair
from lidarium.mapping.merging.rigid import Transform
from lidarium.mapping.merging.settings import merge_settings

A_FROM_B, B_FROM_C = Transform(1.0, 2.0, 0.3), Transform(-2.0, 0.5, 1.2)


def chain(*edges):
    tree = FrameTree()
    for edge in edges:
        tree.add_edge(edge)
    return tree


def near(first, second):
    assert first is not None
    distance, angle = first.difference(second)
    return distance < 1e-9 and angle < 1e-9


def test_a_chain_of_three_maps_is_looked_up_in_all_directions():
    tree = chain(Edge("a", "b", A_FROM_B, 5.0), Edge("b", "c", B_FROM_C, 4.0))
    assert near(tree.lookup("a", "c"), A_FROM_B @ B_FROM_C)
    assert near(tree.lookup("c", "a"), (A_FROM_B @ B_FROM_C).inverse())
    assert near(tree.lookup("b", "b"), Transform())
    assert near(tree.pose_in("a", "c", Transform(1.0, 0.0, 0.1)), A_FROM_B @ B_FROM_C @ Transform(1.0, 0.0, 0.1))
    assert tree.groups() == [["a", "b", "c"]]


def test_a_cycle_that_does_not_close_loses_its_weakest_edge():
    wrong = Transform(4.0, 4.0, 0.0)
    edges = [Edge("a", "b", A_FROM_B, 5.0), Edge("b", "c", B_FROM_C, 4.0), Edge("a", "c", wrong, 3.0)]
    for order in itertools.permutations(edges):
        tree = chain(*order)
        assert [edge.weight for edge in tree.dropped] == [3.0]
        assert near(tree.lookup("a", "c"), A_FROM_B @ B_FROM_C)


def test_a_cycle_that_closes_keeps_all_edges():
    tree = chain(Edge("a", "b", A_FROM_B, 5.0), Edge("b", "c", B_FROM_C, 4.0), Edge("c", "a", (A_FROM_B @ B_FROM_C).inverse(), 3.0))
    assert tree.dropped == []
    assert len(tree.edges) == 3


def test_misses_around_a_cycle_are_taken_where_the_maps_overlap():
    """Far from the origin a small angle is a long way, which says nothing of the overlap."""
    place = (100.0, 0.0)
    turn = Transform(0.0, 0.0, math.radians(1.0))
    shift = np.array(place) - turn.apply(place)
    about_place = Transform(float(shift[0]), float(shift[1]), turn.theta)
    tree = chain(Edge("a", "b", Transform(), 2.0), Edge("b", "c", Transform(), 2.0), Edge("a", "c", about_place, 1.0, place))
    assert tree.dropped == []
    tree = chain(Edge("a", "b", Transform(), 2.0), Edge("b", "c", Transform(), 2.0), Edge("a", "c", about_place, 1.0))
    assert len(tree.dropped) == 1


def test_two_groups_have_no_common_frame():
    tree = chain(Edge("a", "b", A_FROM_B, 1.0), Edge("c", "d", A_FROM_B, 1.0))
    tree.add_map("e")
    assert tree.groups() == [["a", "b"], ["c", "d"], ["e"]]
    assert tree.lookup("a", "c") is None
    assert tree.pose_in("a", "e", Transform()) is None
    with pytest.raises(ValueError, match="no map 'z'"):
        tree.lookup("a", "z")


def test_the_world_stays_where_it_is_while_groups_join_and_edges_improve():
    tree = FrameTree()
    for name in "abcd":
        tree.add_map(name)
    tree.add_edge(Edge("c", "d", A_FROM_B, 1.0))
    assert tree.groups()[0] == ["c", "d"]
    tree.add_edge(Edge("a", "b", A_FROM_B, 9.0))
    tree.add_edge(Edge("b", "c", B_FROM_C, 2.0))
    assert tree.groups()[0][0] == "c"
    assert near(tree.lookup("c", "d"), A_FROM_B)
    tree.add_edge(Edge("c", "d", Transform(9.0, 9.0, 0.0), 0.5))
    assert near(tree.lookup("c", "d"), A_FROM_B)
    better = Transform(1.01, 2.0, 0.3)
    tree.add_edge(Edge("c", "d", better, 3.0))
    assert near(tree.lookup("c", "d"), better)
    tree.remove_edge("b", "c")
    assert tree.groups() == [["c", "d"], ["a", "b"]]


@pytest.mark.parametrize("edge", [Edge("a", "a", Transform(), 1.0), Edge("a", "b", Transform(math.nan, 0.0, 0.0), 1.0)])
def test_bad_edges_are_refused(edge):
    with pytest.raises(ValueError, match="itself|finite"):
        FrameTree().add_edge(edge)


def test_maps_that_agree_fuse_to_the_same_map_and_tell_who_saw_what():
    left, right = kept(apartment(), slice(0, 180), slice(0, 130)), kept(apartment(), slice(0, 180), slice(90, 220))
    fused = fuse([left, right], [Transform(), Transform()], RESOLUTION)
    row, column = (round(value / RESOLUTION) for value in fused.origin[::-1])
    inside = apartment()[row : row + fused.levels.shape[0], column : column + fused.levels.shape[1]]
    np.testing.assert_array_equal(fused.levels, inside)
    seen = ((left != UNKNOWN).astype(int) + 2 * (right != UNKNOWN))[row : row + inside.shape[0], column : column + inside.shape[1]]
    np.testing.assert_array_equal(fused.sources, seen)


@pytest.mark.parametrize(("votes", "level"), [((0, 255), OCCUPIED), ((0, 255, 255), FREE), ((127, 255), FREE), ((127, 127, 0), OCCUPIED)])
def test_free_needs_a_majority_over_occupied(votes, level):
    fused = fuse([np.full((2, 2), vote, np.uint8) for vote in votes], [Transform()] * len(votes), 0.1)
    assert (fused.levels == level).all()


@settings(max_examples=15, deadline=None)
@given(st.floats(-3, 3), st.floats(-5, 5), st.floats(-5, 5))
def test_a_fused_map_lies_where_the_transform_puts_it(theta, x, y):
    pose = Transform(x, y, theta)
    fused = fuse([room(blank(40, 50), 10, 10, 20, 30)], [pose], 0.1)
    rows, columns = np.nonzero(fused.levels == FREE)
    middle = np.array([columns.mean() + 0.5, rows.mean() + 0.5]) * 0.1 + fused.origin
    np.testing.assert_allclose(middle, pose.apply((2.5, 2.0)), atol=0.03)


def test_nothing_known_cannot_be_fused():
    with pytest.raises(ValueError, match="knows anything"):
        fuse([blank()], [Transform()], 0.1)
    with pytest.raises(ValueError, match="0 maps"):
        fuse([], [], 0.1)


def parts():
    """Three turned parts of one apartment, and where they belong."""
    slices = {"west": slice(0, 120), "middle": slice(40, 170), "east": slice(75, 220)}
    poses = {"west": about_middle(0.4, apartment()), "middle": about_middle(2.9, apartment()), "east": about_middle(-1.3, apartment())}
    maps = {}
    for seed, (name, columns) in enumerate(slices.items()):
        maps[name] = (noisy(moved(kept(apartment(), slice(0, 180), columns), poses[name]), seed), RESOLUTION)
    return maps, poses


@pytest.mark.parametrize("order", [("west", "middle", "east"), ("east", "west", "middle")])
def test_many_maps_become_one_in_any_order(order):
    maps, poses = parts()
    maps["elsewhere"] = (room(blank(), 20, 20, 90, 130), RESOLUTION)
    merged = merge_maps({name: maps[name] for name in (*order, "elsewhere")})
    groups = merged.groups()
    assert [sorted(group) for group in groups] == [["east", "middle", "west"], ["elsewhere"]]
    for a, b in itertools.combinations(order, 2):
        found = merged.tree.lookup(a, b)
        assert found is not None
        distance, angle = found.difference(poses[a] @ poses[b].inverse(), (8.0, 8.0))
        assert distance < 0.1
        assert angle < math.radians(1.0)
    fused = merged.fused(groups[0])
    assert np.count_nonzero(fused.levels == FREE) == pytest.approx(np.count_nonzero(apartment() == FREE), rel=0.05)
    with pytest.raises(ValueError, match="not joined"):
        merged.fused([groups[0][0], "elsewhere"])


def test_maps_of_different_resolutions_are_brought_to_the_coarsest():
    fine = np.repeat(np.repeat(apartment(), 2, axis=0), 2, axis=1)
    merged = merge_maps({"fine": (fine, RESOLUTION / 2.0), "coarse": (apartment(), RESOLUTION)})
    assert merged.resolution == RESOLUTION
    assert len(merged.groups()) == 1


@pytest.mark.parametrize(
    ("maps", "message"),
    [
        ({}, "no maps"),
        ({"hall": (blank(), 0.0)}, "'hall'.*resolution"),
        ({"hall": (blank(), math.nan)}, "'hall'.*resolution"),
        ({"hall": (np.zeros((0, 3), np.uint8), 0.1)}, "'hall'.*shape"),
        ({"hall": (np.zeros((3, 3, 3), np.uint8), 0.1)}, "'hall'.*shape"),
    ],
)
def test_bad_maps_are_named(maps, message):
    with pytest.raises(ValueError, match=message):
        merge_maps(maps)


def driven(floor, start, seconds, seed):
    """The map of a robot that starts somewhere, and its pose in the floor."""
    lidar_noise = make_settings(robots=1, known_starts=False, noise="datasheet", resolution=RESOLUTION, horizon_s=seconds)
    env = ExplorationEnv(floor, lidar_noise)
    run_episode(lidarium.policy("nearest_frontier"), env, seed, {"starts": [start]})
    belief = env.perception.belief("robot_0")
    log_odds = np.array(belief.map.log_odds)
    levels = np.select([log_odds > 0, log_odds < 0], [OCCUPIED, FREE], UNKNOWN).astype(np.uint8)
    rows, columns = np.nonzero(levels != UNKNOWN)
    cut = levels[rows.min() : rows.max() + 1, columns.min() : columns.max() + 1]
    x, y = np.array(belief.map_origin) + np.array([columns.min(), rows.min()]) * RESOLUTION
    return np.ascontiguousarray(cut), Transform(*start) @ Transform(float(x), float(y), 0.0)


def test_maps_of_robots_that_start_apart_are_joined_where_they_met():
    first, floor_from_first = driven("apartment", (2.5, 4.0, 0.0), 40.0, 1)
    second, floor_from_second = driven("apartment", (7.0, 4.0, 2.0), 40.0, 2)
    other, _ = driven("building:17", (17.025, 22.475, 1.58), 20.0, 3)
    merged = merge_maps({"first": (first, RESOLUTION), "other": (other, RESOLUTION), "second": (second, RESOLUTION)})
    assert merged.groups() == [["first", "second"], ["other"]]
    found = merged.tree.lookup("first", "second")
    assert found is not None
    truth = floor_from_first.inverse() @ floor_from_second
    distance, angle = found.difference(truth, merged.pairs["first", "second"].agreement.centre)
    assert distance < 0.1
    assert angle < math.radians(1.0)


def real_truth(pixel, resolution, rows_a, rows_b):
    """Transform of a pair whose truth is q_a = R q_b + t in pixels, y down."""
    theta = math.radians(pixel["theta_deg"])
    corner = Transform(pixel["tx"], pixel["ty"], theta).apply((0.0, rows_b))
    return Transform(float(corner[0]) * resolution, (rows_a - float(corner[1])) * resolution, -theta)


def test_a_transform_of_pixels_that_run_down_is_turned_round():
    truth = real_truth({"theta_deg": 30.0, "tx": 1.0, "ty": -2.0}, 0.1, 40, 50)
    pixel_b = np.array([7.0, 11.0])
    pixel_a = Transform(1.0, -2.0, math.radians(30.0)).apply(pixel_b)
    place_b = np.array([pixel_b[0], 50.0 - pixel_b[1]]) * 0.1
    place_a = np.array([pixel_a[0], 40.0 - pixel_a[1]]) * 0.1
    np.testing.assert_allclose(truth.apply(place_b), place_a)


@pytest.mark.parametrize("name", ["intel_hard", "freiburg-079_easy", "freiburg-079_hard", "csail_hard", "belgioioso_hard"])
def test_real_maps_are_joined_right_or_refused(shared_data, name):
    folder = shared_data / "map_pairs" / "log_split"
    if not folder.is_dir():
        pytest.skip(f"no pairs of maps at {folder}")
    truth = json.loads((folder / "ground_truth.json").read_text())[name]
    resolution = truth["resolution"]
    a, b = (read_grey_map(folder / truth[key], resolution).levels for key in "AB")
    chosen = merge_settings()
    result = merge_pair(described(a, resolution, chosen), described(b, resolution, chosen), chosen)
    if name in ("intel_hard", "freiburg-079_easy", "csail_hard"):
        assert result.is_accepted, result.reason
    if result.is_accepted:
        assert result.a_from_b is not None
        wanted = real_truth(truth["pixel"], resolution, a.shape[0], b.shape[0])
        distance, angle = result.a_from_b.difference(wanted, result.agreement.centre)
        assert distance < 0.1
        assert angle < math.radians(1.0)
