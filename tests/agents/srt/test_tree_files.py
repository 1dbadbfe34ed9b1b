"""Trees are written and read back as they were, and grow on from a file; damaged files are refused."""

import math

import numpy as np
import pytest

import lidarium
from lidarium.agents.srt.policy import SensorBasedRandomTree
from lidarium.agents.srt.tree_files import read_tree
from lidarium.evaluation.episodes.runner import run_episode


def explored(horizon_s, seed=1, floor="apartment", robots=1, options=None, **chosen):
    env = lidarium.parallel_env(
        floor, robots=robots, horizon_s=horizon_s, stop_coverage=None, map_cells=32, starts="fixed"
    )
    return run_episode(SensorBasedRandomTree(memory="regions", **chosen), env, seed, options=options)


@pytest.fixture(scope="module")
def episode():
    return explored(60.0, robots=2)


@pytest.fixture(scope="module")
def path(episode, tmp_path_factory):
    folder = tmp_path_factory.mktemp("tree")
    assert episode.policy.write_trees(folder) == ["tree.npz"]
    return folder / "tree.npz"


def test_a_tree_is_read_as_it_was(episode, path):
    belief = episode.env.belief("robot_0")
    found = read_tree(path, np.add(belief.frame, belief.map_origin))
    assert len(found.nodes) == len(episode.policy.tree.nodes) > 10
    for one, other in zip(found.nodes, episode.policy.tree.nodes, strict=True):
        assert (one.number, one.agent, one.parent, one.has_turned) == (
            other.number,
            other.agent,
            other.parent,
            other.has_turned,
        )
        np.testing.assert_allclose(one.pose, other.pose, atol=1e-9)
        np.testing.assert_array_equal(one.view, other.view.astype(np.float32))
        np.testing.assert_allclose(one.safe.radii, other.safe.radii, atol=1e-6)
        assert one.neighbours.keys() == other.neighbours.keys()
        flags = [[(o.is_closed, o.is_tried, o.is_gap) for o in node.openings] for node in (one, other)]
        assert flags[0] == flags[1]
    assert {node.agent for node in found.nodes} == {"robot_0", "robot_1"}


def test_places_of_a_file_are_on_the_floor(episode, path):
    starts = episode.env.world.starts
    for node in read_tree(path).nodes:
        if node.parent is None:
            assert math.dist(node.place, starts[int(node.agent[-1])][:2]) < 0.1


def test_a_tree_grows_on_in_a_later_run(path):
    before = len(read_tree(path).nodes)
    later = explored(30.0, seed=5, tree=str(path))
    tree = later.policy.tree
    assert len(tree.nodes) > before
    root = tree.nodes[before]
    assert root.parent is None
    assert set(root.neighbours) & set(range(before))  # it stands in the old tree
    # A robot without the tree sees what is known by now once more.
    blank = explored(30.0, seed=5).policy.tree
    assert new_area(tree.nodes[:before], tree.nodes[before:]) > new_area(tree.nodes[:before], blank.nodes) + 0.5


def test_a_robot_whose_first_scan_is_blind_towards_the_tree_joins_it_when_it_has_turned(tmp_path):
    first = explored(15.0, floor="srt_l_room")
    first.policy.write_trees(tmp_path)
    before = len(first.policy.tree.nodes)
    start = first.env.world.starts[0]
    behind = start + 0.01 * np.array([math.cos(start[2]), math.sin(start[2]), 0.0])
    later = explored(60.0, floor="srt_l_room", tree=str(tmp_path / "tree.npz"), options={"starts": behind[None]})
    root = later.policy.tree.nodes[before]
    assert root.parent is None
    assert 0 in root.neighbours
    assert later.env.scorer.ended_because == {"robot_0": "reached"}


def new_area(old, nodes):
    """The area that nodes have seen, and old ones have not [m2]."""
    places = np.stack(np.meshgrid(np.arange(-15.0, 15.0, 0.1), np.arange(-15.0, 15.0, 0.1)), -1).reshape(-1, 2)
    by_old, by_new = (np.any([node.seen.contains(places) for node in part], axis=0) for part in (old, nodes))
    return (by_new & ~by_old).sum() * 0.1**2


def test_robots_that_do_not_know_their_starts_have_a_tree_each(tmp_path):
    env = lidarium.parallel_env("apartment", robots=2, horizon_s=15.0, known_starts=False, map_cells=32)
    episode = run_episode(SensorBasedRandomTree(memory="regions"), env, 1)
    assert episode.policy.write_trees(tmp_path) == ["robot_0_tree.npz", "robot_1_tree.npz"]
    for robot in range(2):
        nodes = read_tree(tmp_path / f"robot_{robot}_tree.npz").nodes
        assert {node.agent for node in nodes} == {f"robot_{robot}"}
        np.testing.assert_allclose(nodes[0].pose, 0.0, atol=0.1)  # as seen from its own start
    policy = SensorBasedRandomTree(memory="regions", tree=tmp_path / "robot_0_tree.npz")
    with pytest.raises(ValueError, match=r"tree is .*robot_0_tree.npz and the 2 robots do not know their starts"):
        run_episode(policy, env, 1)


def test_a_tree_needs_the_memory_of_regions(path):
    with pytest.raises(ValueError, match="memory is 'map'; want memory=regions"):
        SensorBasedRandomTree(tree=path)


def changed(name, place, value):
    def change(arrays):
        arrays[name] = arrays[name].copy()
        arrays[name][place] = value

    return change


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (changed("rules", 0, 2), "version is 2; want 1"),
        (changed("rules", 1, 7), "its rules are"),
        (changed("rules", 2, -1.0), "its rules are"),
        (changed("poses", (0, 0), np.nan), "its poses are not all finite"),
        (changed("poses", (0, 0), 1e9), "its poses are not all finite"),
        (changed("bodies", 0, 0.0), "its bodies are not all above 0 m"),
        (changed("views", (0, 0), -1.0), "ranges below 0 m"),
        (changed("parents", 0, 3), "a node comes before its parent"),
        (changed("agent", 0, 9), "its agent have numbers of none; want 0 to 1"),
        (changed("ways", (0, 0), 10_000), "its ways have numbers of none"),
        (changed("openings", 0, 99), "openings"),
        (lambda arrays: arrays.update(views=arrays["views"][:, :9]), "its views have shape"),
        (lambda arrays: arrays.pop("ways"), "ways"),
    ],
)
def test_a_damaged_tree_is_refused(path, tmp_path, change, message):
    with np.load(path) as archive:
        arrays = dict(archive)
    change(arrays)
    np.savez(tmp_path / "bad.npz", **arrays)
    with pytest.raises(ValueError, match=message) as caught:
        read_tree(tmp_path / "bad.npz")
    assert "bad.npz" in str(caught.value)


def test_a_file_that_is_no_tree_is_refused(tmp_path):
    np.savez(tmp_path / "other.npz", a=np.zeros(3))
    with pytest.raises(ValueError, match=r"other\.npz is not a tree"):
        read_tree(tmp_path / "other.npz")
    with pytest.raises(FileNotFoundError):
        read_tree(tmp_path / "missing.npz")
