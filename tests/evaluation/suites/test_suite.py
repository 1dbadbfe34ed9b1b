"""Suites."""

import cv2
import numpy as np
import pytest

from lidarium.envs.floors.catalogue.names import load_floor
from lidarium.evaluation.suites.suite import (
    MOST_EACH,
    ROBOTS,
    Suite,
    check_members,
    check_numbers,
    check_texts,
    check_trials,
    listed,
    read_suite,
    seeds_of,
    starts_of,
    suite_of,
    tables_of,
)
from lidarium.mapping.files.map_files import write_ros_map

TOML = """
policies = ["nearest_frontier", "random_walk"]
floors = ["apartment", "set:test:2"]
robots = [1, 2]
seeds = 3

[settings]
resolution = 0.05
horizon_s = 60.0

[variants.clean]

[variants.noisy]
noise = "datasheet"

[starts]
apartment = [[[1.0, 1.5, 0.0], [2.0, 1.5, 0.0]], [[3.0, 1.5, 0.5], [2.0, 1.5, 0.0]]]
"""


def suite(**changes):
    return Suite(**{"policies": ("nearest_frontier",), "floors": ("apartment",), **changes})


def test_trials_are_the_product_and_all_keys_and_names_differ(tmp_path):
    (tmp_path / "suite.toml").write_text(TOML)
    trials = list(read_suite(tmp_path / "suite.toml").trials())
    assert len(trials) == 2 * (2 + 1 + 1) * 2 * 3 * 2
    assert len({trial.key for trial in trials}) == len({trial.file_name for trial in trials}) == len(trials)
    assert {trial.floor for trial in trials} == {"apartment", "building:3000000", "building:3000001"}


@pytest.fixture
def folder(tmp_path):
    """Return a folder of a plain image, which states no scale, of a ROS map, which does, and of their licence."""
    levels = np.full((40, 60), 255, np.uint8)
    levels[0] = levels[-1] = levels[:, 0] = levels[:, -1] = 0
    (tmp_path / "floors").mkdir()
    write_ros_map(tmp_path / "floors", "room", levels, (0.0, 0.0, 0.0), 0.05)
    cv2.imwrite(str(tmp_path / "floors" / "hall.png"), levels)
    (tmp_path / "floors" / "LICENCE.txt").write_text("Free to use.")
    return tmp_path / "floors"


def test_a_folder_is_its_floors_of_which_images_alone_take_the_side_of_a_pixel(folder):
    found = suite(floors=(str(folder), "apartment"), image_resolution=0.1)
    hall, room = str(folder / "hall.png"), str(folder / "room.yaml")
    assert [trial.floor for trial in found.trials()] == [hall, room, "apartment"]
    assert [found.pixel_side(floor) for floor in (hall, room, "apartment")] == [0.1, None, None]
    assert load_floor(hall, found.pixel_side(hall)).bounds[2:] == pytest.approx((6.0, 4.0), abs=0.15)  # its walls
    with pytest.raises(ValueError, match="its own scale"):
        suite(floors=(room,), image_resolution=0.1)
    with pytest.raises(ValueError, match="which are many"):
        suite(floors=(str(folder),), image_resolution=0.1, starts={str(folder): [[(1.0, 1.0, 0.0)]]})


def test_trials_that_are_paired_follow_each_other():
    trials = list(suite(policies=("nearest_frontier", "random_walk"), seeds=(0, 1)).trials())
    assert [(trial.seed, trial.policy) for trial in trials[:2]] == [
        (0, "nearest_frontier"),
        (0, "random_walk"),
    ]


def test_variants_add_to_the_common_settings(tmp_path):
    (tmp_path / "suite.toml").write_text(TOML)
    made = read_suite(tmp_path / "suite.toml")
    clean, noisy = (made.settings(name, 2) for name in ("clean", "noisy"))
    assert clean.occupancy.resolution == noisy.occupancy.resolution == 0.05
    assert noisy.lidar.is_noisy
    assert not clean.lidar.is_noisy
    assert clean.robots == 2


def test_given_starts_are_taken_in_place_of_drawn_ones(tmp_path):
    (tmp_path / "suite.toml").write_text(TOML)
    made = read_suite(tmp_path / "suite.toml")
    by_floor = {trial.floor: made.starts_of(trial) for trial in made.trials() if trial.robots == 1 and trial.start != 1}
    assert by_floor["apartment"] == [[1.0, 1.5, 0.0]]
    assert by_floor["building:3000000"] is None


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"policies": ("nearest_fronteer",)}, "nearest_frontier"),
        ({"policies": ()}, "no policies"),
        ({"policies": ("random_walk", "random_walk")}, "twice"),
        ({"floors": ("appartment",)}, "apartment"),
        ({"floors": ("set:tset",)}, "test"),
        ({"floors": ("set:test:0",)}, "has 200"),
        ({"robots": (0,)}, "from 1 to 64"),
        ({"seeds": (-1,)}, "of 0 or more"),
        ({"seeds": (True,)}, "a whole number"),
        ({"variants": {"a": {"noise": "loud"}}}, "variant 'a'"),
        ({"variants": {"a": {"robots": 3}}}, "leave it out"),
        ({"variants": {"a": {"speed": 3}}}, "variant 'a'"),
        ({"starts": {"clinic": ()}}, "not among its floors"),
        ({"starts": {"apartment": ()}}, "no starts on 'apartment'; want at least one team"),
        ({"starts": {"apartment": (((1.0, 1.5, 0.0),),)}, "robots": (2,)}, "at least 2"),
    ],
)
def test_bad_suites_are_refused_with_a_reason(changes, message):
    with pytest.raises(ValueError, match=message):
        suite(**changes)


def test_files_that_are_no_suites_are_refused(tmp_path):
    with pytest.raises(FileNotFoundError, match="no suite"):
        read_suite(tmp_path / "none.toml")
    path = tmp_path / "bad.toml"
    for content, message in (
        ("policies = [", "not TOML"),
        ("floors = ['apartment']", "no policies"),
        ("polices = []", "no 'polices'"),
    ):
        path.write_text(content)
        with pytest.raises(ValueError, match=message):
            read_suite(path)
    with pytest.raises(ValueError, match="tables"):
        suite_of({"policies": ["random_walk"], "floors": ["apartment"], "settings": 3})
    with pytest.raises(ValueError, match="want a list"):
        suite_of({"policies": {"random_walk": 1}, "floors": ["apartment"]})


def test_a_number_of_seeds_is_counted_from_0():
    assert seeds_of(3, {"seeds": 3}) == (0, 1, 2)
    assert seeds_of([5, 9], {"seeds": [5, 9]}) == (5, 9)


def test_one_name_stands_for_a_list_of_it():
    assert listed({"floors": "clinic"}, "floors") == ("clinic",)
    assert listed({"floors": ["clinic", "office"]}, "floors") == ("clinic", "office")


def test_teams_of_starts_are_kept_by_floor():
    content = {"clinic": [[[1, 2.0, 0.5]], [[1, 2, 0], [3, 4, 0]]]}
    assert starts_of(content) == {"clinic": (((1, 2.0, 0.5),), ((1, 2, 0), (3, 4, 0)))}
    assert starts_of({}) == {}


def test_tables_are_copies():
    content = {"noisy": {"noise": "datasheet"}}
    tables_of(content, "variants")["noisy"]["noise"] = "none"
    assert content == {"noisy": {"noise": "datasheet"}}


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: check_members("floors", []), "has no floors; want at least one"),
        (lambda: check_members("floors", ["a", "b", "a"]), "names 'a' twice among its floors"),
        (lambda: check_members("floors", [["a"]]), "among its floors; want names or numbers"),
        (lambda: check_members("seeds", range(MOST_EACH + 1)), "has 1,000,001 seeds"),
        (lambda: check_numbers("robots", [2, 2.5], ROBOTS), "robots of the suite has 2.5"),
        (lambda: check_texts("floors", ["a", 3]), "floors of the suite has 3; want names"),
        (lambda: check_trials(10_000, 1001), "has 10,010,000 episodes"),
        (lambda: seeds_of(0, {"seeds": 0}), "seeds of the suite is 0"),
        (lambda: seeds_of(True, {"seeds": 2.5}), "seeds of the suite is 2.5; want a list"),
        (lambda: tables_of({"a": 3}, "variants"), r"as in \[variants.name\]"),
        (lambda: starts_of([1]), "want a table of teams by floor"),
        (lambda: starts_of({"clinic": [[[1.0, 2.0]]]}), r"a start on 'clinic' is .*; want x, y"),
        (lambda: starts_of({"clinic": [[1.0, 2.0, 3.0]]}), "starts on 'clinic' has 1.0"),
        (lambda: starts_of({"clinic": [[[1.0, 2.0, float("nan")]]]}), "a start on 'clinic'"),
    ],
)
def test_what_a_suite_cannot_hold_is_named(call, message):
    with pytest.raises(ValueError, match=message):
        call()


def test_trials_up_to_the_limit_are_fine():
    check_trials(10_000, 1000, 0)
    check_members("floors", ["a"])
