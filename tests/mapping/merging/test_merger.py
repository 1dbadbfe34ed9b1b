import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from drawn_maps import RESOLUTION, about_middle, apartment, blank, bowed, hall, kept, moved, noisy, room

import lidarium
from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.settings.making import make_settings
from lidarium.evaluation.episodes.runner import run_episode
from lidarium.mapping.files.map_files import FREE, UNKNOWN
from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.grids.occupancy import three_levels
from lidarium.mapping.merging import merger
from lidarium.mapping.merging.joining import joined_tree
from lidarium.mapping.merging.merger import merge_maps
from lidarium.mapping.merging.pair import described, merge_pair
from lidarium.mapping.merging.settings import MergeSettings, merge_settings


def parts():
    """Three turned parts of one apartment, and where they belong."""
    slices = {"west": slice(0, 120), "middle": slice(40, 170), "east": slice(75, 220)}
    poses = {
        "west": about_middle(0.4, apartment()),
        "middle": about_middle(2.9, apartment()),
        "east": about_middle(-1.3, apartment()),
    }
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


def test_maps_that_others_join_are_verified_instead_of_searched_for():
    poses = [about_middle(theta, apartment()) for theta in (0.0, 0.9, 2.2, -1.4)]
    maps = {str(k): (noisy(moved(apartment(), pose), k), RESOLUTION) for k, pose in enumerate(poses)}
    merged = merge_maps(maps)
    assert list(merged.pairs) == list(itertools.combinations(maps, 2))
    assert all(result.is_accepted for result in merged.pairs.values())
    assert sum(result.found_by != "verification" for result in merged.pairs.values()) == len(maps) - 1
    for (a, b), result in merged.pairs.items():
        distance, angle = result.a_from_b.difference(poses[int(a)] @ poses[int(b)].inverse(), (8.0, 8.0))
        assert distance < 0.1
        assert angle < math.radians(1.0)


def test_the_thesis_mode_searches_for_every_pair_once(monkeypatch):
    poses = [about_middle(theta, apartment()) for theta in (0.0, 0.9, 2.2)]
    maps = {str(k): (moved(apartment(), pose), RESOLUTION) for k, pose in enumerate(poses)}
    searched = []

    def noted(*pair_and_settings):
        searched.append(pair_and_settings[:2])
        return merge_pair(*pair_and_settings)

    monkeypatch.setattr(merger, "merge_pair", noted)
    found = merge_maps(
        {**maps, "elsewhere": (room(blank(), 20, 20, 90, 130), RESOLUTION)},
        merge_settings("thesis", RESOLUTION),
    )
    assert "verification" not in {result.found_by for result in found.pairs.values()}
    assert len(searched) == len(found.pairs) == 6


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
    chosen = make_settings(robots=1, known_starts=False, noise="datasheet", resolution=RESOLUTION, horizon_s=seconds)
    env = ExplorationEnv(floor, chosen)
    run_episode(lidarium.policy("nearest_frontier"), env, seed, {"starts": [start]})
    belief = env.belief("robot_0")
    levels = three_levels(np.array(belief.map.log_odds))
    rows, columns = np.nonzero(levels != UNKNOWN)
    cut = levels[rows.min() : rows.max() + 1, columns.min() : columns.max() + 1]
    x, y = np.array(belief.map_origin) + np.array([columns.min(), rows.min()]) * RESOLUTION
    return np.ascontiguousarray(cut), Transform(*start) @ Transform(float(x), float(y), 0.0)


def test_maps_of_robots_that_start_apart_are_joined_where_they_met():
    first, floor_from_first = driven("apartment", (2.5, 4.0, 0.0), 40.0, 1)
    second, floor_from_second = driven("apartment", (8.5117, 5.0262, -0.966), 40.0, 2)
    other, _ = driven("building:17", (17.025, 22.475, 1.58), 20.0, 3)
    merged = merge_maps({"first": (first, RESOLUTION), "other": (other, RESOLUTION), "second": (second, RESOLUTION)})
    assert merged.groups() == [["first", "second"], ["other"]]
    found = merged.tree.lookup("first", "second")
    assert found is not None
    truth = floor_from_first.inverse() @ floor_from_second
    distance, angle = found.difference(truth, merged.pairs["first", "second"].agreement.centre)
    assert distance < 0.1
    assert angle < math.radians(1.0)


def test_a_ring_of_bent_maps_is_joined_and_its_one_false_pair_is_named():
    whole, settings = hall(), MergeSettings()
    parts = {
        "west": kept(whole, slice(0, 180), slice(0, 260)),
        "east": kept(whole, slice(0, 180), slice(100, 400)),
        "south": kept(whole, slice(0, 130), slice(0, 400)),
        "north": kept(whole, slice(50, 180), slice(0, 400)),
        "all": whole,
    }
    sags = (0.0, 0.25, -0.2, 0.15, 0.3)
    maps = {name: (bowed(part, sag), RESOLUTION) for (name, part), sag in zip(parts.items(), sags, strict=True)}
    merged = merge_maps(maps)
    assert len(merged.groups()) == 1
    assert not merged.tree.dropped
    for name in parts:
        transform = merged.tree.lookup("west", name)
        assert transform is not None
        distance, angle = transform.difference(Transform(), (7.0, 4.0))
        assert distance < 0.3
        assert angle < math.radians(3.0)
    false = replace(merged.pairs["south", "north"], a_from_b=Transform(3.0, 0.0, 0.0))
    weak = replace(false.agreement, agreeing_m=8.0, wall_m=9.0)
    pairs = {**merged.pairs, ("south", "north"): replace(false, agreement=weak, found_by="corners")}
    features = {name: described(levels, RESOLUTION, settings) for name, levels in merged.levels.items()}
    tree = joined_tree(features, pairs, settings)
    assert [(edge.a, edge.b) for edge in tree.dropped] == [("south", "north")]
    assert len(tree.groups()) == 1


def test_maps_of_too_many_cells_are_refused_with_the_limit():
    one = np.broadcast_to(np.uint8(255), (20_000, 20_000))
    with pytest.raises(ValueError, match=r"'large': .* want at most 50,000,000 cells"):
        merge_maps({"large": (one, 0.05), "small": (hall(), 0.05)})


@pytest.mark.parametrize("scale", [0.0, -1.0, math.nan, math.inf])
def test_scales_that_are_none_are_refused(scale):
    with pytest.raises(ValueError, match="'b': the resolution of a map is"):
        merge_maps({"a": (hall(), 0.05), "b": (hall(), scale)})


def test_pairs_that_join_have_a_confidence_and_rivals():
    maps, _ = parts()
    merged = merge_maps({name: maps[name] for name in ("west", "middle")})
    (found,) = merged.pairs.values()
    assert found.is_accepted
    assert found.confidence > 0.9
    assert found.ranked
    half = kept(apartment(), slice(0, 180), slice(0, 110))
    mirrored = np.concatenate([half, half[:, ::-1]], axis=1)
    merged = merge_maps({"p": (mirrored, RESOLUTION), "q": (np.rot90(mirrored).copy(), RESOLUTION)})
    assert all(pair.doubt or not pair.is_accepted for pair in merged.pairs.values())


def test_questions_are_given_by_their_names():
    maps, poses = parts()
    two = {name: maps[name] for name in ("west", "middle")}
    true = poses["west"] @ poses["middle"].inverse()
    guess = (true.x + 0.2, true.y - 0.1, true.theta + 0.05)
    found = lidarium.merge_maps(two, question={"guess": guess})
    by_transform = merge_maps(two, question=merger.Question(guess=Transform(*guess)))
    assert found.tree.lookup("west", "middle") == by_transform.tree.lookup("west", "middle") is not None
    with pytest.raises(ValueError, match="unknown question 'gues'; did you mean 'guess'"):
        lidarium.merge_maps(two, question={"gues": guess})
    with pytest.raises(ValueError, match=r"guess is \(1\.0, 2\.0\); want x, y and theta in metres and radians"):
        lidarium.merge_maps(two, question={"guess": (1.0, 2.0)})
