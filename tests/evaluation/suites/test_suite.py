"""A suite says what to run; each trial has a name of its own."""

import pytest

from lidarium.evaluation.suites.suite import Suite, read_suite, suite_of

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
    by_floor = {
        trial.floor: made.starts_of(trial)
        for trial in made.trials()
        if trial.robots == 1 and trial.start != 1
    }
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
