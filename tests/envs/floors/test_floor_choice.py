"""Which floor an episode takes: one, or one drawn from a set, a list, a folder, weights, a callable."""

from collections import Counter

import numpy as np
import pytest

import lidarium
from lidarium.envs.floors.catalogue.names import load_floor
from lidarium.envs.floors.floor_choice import FloorChoice
from lidarium.mapping.files.map_files import write_ros_map

NAMES = ("scene_room", "scene_loop", "scene_corner")


def drawn(floor, count=200, **options):
    """How often each floor is drawn, by its name."""
    choice, generator = FloorChoice(floor, **options), np.random.default_rng(5)
    return Counter(choice.load(generator).name for _ in range(count))


def test_a_set_draws_its_floors_from_the_generator_and_one_floor_draws_nothing():
    choice = FloorChoice("set:test")
    first = [choice.load(np.random.default_rng(1)) for _ in range(3)]
    assert first[0] is first[1] is first[2]
    generator = np.random.default_rng(1)
    assert len({choice.load(generator).sha256 for _ in range(20)}) > 10
    generator, untouched = np.random.default_rng(1), np.random.default_rng(1)
    assert FloorChoice("apartment").load(generator).name == "apartment"
    assert generator.random() == untouched.random()


def test_an_unknown_set_is_refused_with_the_known_ones():
    with pytest.raises(ValueError, match="validation"):
        FloorChoice("set:training")


def test_a_list_draws_each_of_its_floors():
    found = drawn([*NAMES[:2], load_floor(NAMES[2])])
    assert set(found) == set(NAMES)
    assert min(found.values()) > 40


def test_weights_say_how_often_each_floor_is_drawn():
    found = drawn({NAMES[0]: 3, NAMES[1]: 1.0})
    assert 130 < found[NAMES[0]] < 170
    assert found[NAMES[0]] + found[NAMES[1]] == 200


def test_a_callable_draws_by_the_generator_of_the_episode():
    assert set(drawn(lambda generator: NAMES[generator.integers(2)])) == set(NAMES[:2])
    choice = FloorChoice(lambda generator: f"building:{generator.integers(5)}")
    same = {choice.load(np.random.default_rng(3)).name for _ in range(3)}
    assert len(same) == 1


def test_lists_may_hold_sets_and_lists():
    found = drawn(["set:test:2", ["apartment", "clinic"]], 100)
    assert {"apartment", "clinic"} < set(found)
    assert len(found) == 4


@pytest.fixture
def folder(tmp_path):
    levels = np.full((40, 60), 255, np.uint8)
    levels[0] = levels[-1] = levels[:, 0] = levels[:, -1] = 0
    write_ros_map(tmp_path, "room", levels, (0.0, 0.0, 0.0), 0.05)
    np.save(tmp_path / "grid.npy", levels == 0)
    for name in ("readme.md", "LICENCE.txt"):  # the name of the second is that of a floor
        (tmp_path / name).write_text("Free to use, as these floors are.\n")
    return tmp_path


def test_a_folder_draws_its_floors_and_no_picture_of_a_map_twice(folder):
    found = drawn(folder, image_resolution=0.05)
    assert set(found) == {"room", "grid"}
    assert set(drawn(str(folder), image_resolution=0.05)) == {"room", "grid"}


def test_a_folder_of_no_floors_is_refused(tmp_path):
    (tmp_path / "readme.md").write_text("no floor")
    with pytest.raises(ValueError, match=r"has no floors; want files that end in .*\.yaml"):
        FloorChoice(tmp_path)


@pytest.mark.parametrize(
    ("floor", "words"),
    [
        ([], "floor is \\[\\]; want a name"),
        ({}, "floor is {}; want a name"),
        (17, "floor is 17; want a name"),
        ({"apartment": 0.0}, "the weight of floor 'apartment' is 0.0; want a positive number"),
        ({"apartment": "often"}, "the weight of floor 'apartment' is 'often'"),
        ({"apartment": True}, "the weight of floor 'apartment' is True"),
        (["apartmnt"], "no floor called 'apartmnt', did you mean 'apartment'"),
        (["apartment", "apartmnt"], "no floor called 'apartmnt', did you mean 'apartment'"),
        ({"apartment": 1, "building:x": 1}, "floor 'building:x' has seed 'x'"),
        (["apartment", "home:nix"], "no floor 'home:nix'"),
        (["apartment", ["set:training"]], "no set called 'training', did you mean 'train'"),
        (["apartment", 17], "floor is 17; want a name"),
        ({"apartment": 1e308, "clinic": 1e308}, "the weights of the floors add up to inf; want a finite sum"),
    ],
)
def test_what_is_no_choice_of_floors_is_refused(floor, words):
    with pytest.raises(ValueError, match=words):
        FloorChoice(floor)


def test_the_first_floor_says_whether_a_goal_is_observed():
    assert FloorChoice(["srt_l_room", "apartment"]).has_goal
    assert not FloorChoice(["apartment", "srt_l_room"]).has_goal
    env = lidarium.parallel_env(["srt_l_room", "apartment"], robots=1, map_cells=64)
    goals = {}
    for seed in range(8):
        observations, _ = env.reset(seed=seed)
        goals[env.floor.name] = observations["robot_0"]["goal"].tolist()
    assert goals["apartment"] == [0.0, 0.0]
    assert goals["srt_l_room"] != [0.0, 0.0]


def test_floors_of_lists_are_looked_up_at_once_but_not_loaded(monkeypatch, folder):
    loaded = []
    monkeypatch.setattr("lidarium.envs.floors.floor_choice.load_floor", lambda *given: loaded.append(given))
    FloorChoice(["building:1", "building:2", "home:17", folder / "room.yaml", "set:test"])
    assert not loaded
    with pytest.raises(FileNotFoundError, match=r"there is no file .*plan\.yaml"):
        FloorChoice(["building:1", str(folder / "plan.yaml")])
    with pytest.raises(ValueError, match=r"readme\.md is of no known floor format"):
        FloorChoice({"building:1": 1, folder / "readme.md": 2})


def test_files_of_nested_choices_are_hashed(folder):
    found = FloorChoice(["building:1", [str(folder / "room.yaml")]]).in_files()
    assert found == {str(folder / "room.yaml"): load_floor(folder / "room.yaml").sha256}
