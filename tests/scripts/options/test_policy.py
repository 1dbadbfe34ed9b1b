"""Settings of policies on the command line."""

import json

import pytest

from lidarium.scripts.main import main
from lidarium.scripts.options.policy import options_by_policy, policy_options

WORLD = ("--floor", "apartment:7", "--robots", "1", "--map-resolution", "0.1", "--horizon-s", "2")
SUITE = ("--floors", "srt_l_room", "--robots", "1", "--seeds", "1", "--horizon-s", "1", "--workers", "1")


def test_values_are_numbers_flags_or_text():
    found = policy_options(["kept=2.0", "shares-map=false", "weights=a/b=c.safetensors", " count = 3 "])
    assert found == {"kept": 2.0, "shares_map": False, "weights": "a/b=c.safetensors", "count": 3}


@pytest.mark.parametrize("assignment", ["kept", "=2", " =2", ""])
def test_what_sets_nothing_is_refused(assignment):
    with pytest.raises(ValueError, match="sets nothing; want KEY=VALUE"):
        policy_options([assignment])


def test_settings_of_several_policies_are_told_apart():
    policies = ("tour_frontier", "my.module:Mine")
    found = options_by_policy(
        ["tour_frontier.kept=1.0", "my.module:Mine.file=a.b=c", "tour_frontier.margin=0.5"], policies
    )
    assert found == {"tour_frontier": {"kept": 1.0, "margin": 0.5}, "my.module:Mine": {"file": "a.b=c"}}


@pytest.mark.parametrize("assignment", ["kept=1.0", "learned.kept=1.0", "tour_frontier=1.0", ".kept=1"])
def test_a_policy_that_is_not_evaluated_is_named(assignment):
    with pytest.raises(ValueError, match=r"names no policy that is evaluated; want POLICY\.KEY=VALUE"):
        options_by_policy([assignment], ["tour_frontier"])


@pytest.mark.parametrize("assignment", ["tour_frontier.kept", "tour_frontier. =1"])
def test_a_policy_whose_key_or_value_is_missing_is_refused(assignment):
    with pytest.raises(ValueError, match="sets nothing"):
        options_by_policy([assignment], ["tour_frontier"])


def refused(arguments, out, capsys, *words):
    assert main([*arguments, "--out", str(out)]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert "Traceback" not in captured.err
    for word in words:
        assert word in captured.err
    assert not out.exists()


@pytest.mark.parametrize(
    ("policy", "assignment", "words"),
    [
        ("tour_frontier", "kepd=1.0", ("'kepd'", "did you mean 'kept'", "known: minimum_size")),
        ("nearest_frontier", "share_map=1", ("'nearest_frontier'", "'share_map'", "known:")),
        ("tour_frontier", "kept=-1.0", ("kept",)),
        ("tour_frontier", "kept=much", ("kept", "much")),
        ("nearest_frontier", "kept", ("sets nothing",)),
        ("supervised", "kepd=1.0", ("policy 'supervised': there is no setting 'kepd'",)),
        ("supervised_learned", "weights=nowhere.safetensors", ("nowhere.safetensors",)),
        ("learned", "weights=nowhere.safetensors", ("nowhere.safetensors",)),
        ("learned", "weights=pyproject.toml", ("pyproject.toml", "no file of weights")),
        ("learned", "weights=3", ("weights is 3; want the name of a file",)),
        ("learned", "kepd=1.0", ("did you mean 'kept'",)),
    ],
)
def test_a_run_refuses_bad_settings_before_anything_is_written(policy, assignment, words, tmp_path, capsys):
    arguments = ["run", *WORLD, "--policy", policy, "--policy-set", assignment]
    refused(arguments, tmp_path / "out", capsys, *words)


def test_a_run_keeps_the_settings_with_its_result(tmp_path, capsys):
    arguments = ["run", *WORLD, "--policy", "tour_frontier", "--policy-set", "kept=2.5", "--json"]
    assert main([*arguments, "--out", str(tmp_path)]) == 0
    capsys.readouterr()
    assert json.loads((tmp_path / "result.json").read_text())["policy_settings"] == {"kept": 2.5}


@pytest.mark.parametrize(
    ("assignment", "words"),
    [
        ("kept=1.0", ("POLICY.KEY=VALUE", "tour_frontier")),
        ("learned.kept=1.0", ("'learned.kept=1.0'", "tour_frontier")),
        ("tour_frontier.kepd=1.0", ("kepd",)),
    ],
)
def test_an_evaluation_refuses_bad_settings_before_anything_is_written(assignment, words, tmp_path, capsys):
    arguments = ["evaluate", *SUITE, "--policies", "tour_frontier", "--policy-set", assignment]
    refused(arguments, tmp_path / "out", capsys, *words)


def test_an_evaluation_takes_settings_of_each_policy(tmp_path, capsys):
    policies = ["--policies", "random_walk", "tour_frontier", "--policy-set", "tour_frontier.kept=2.5"]
    assert main(["evaluate", *SUITE, *policies, "--out", str(tmp_path), "--json"]) == 0
    capsys.readouterr()
    kept = json.loads((tmp_path / "suite.json").read_text())["policy_settings"]
    assert kept == {"tour_frontier": {"kept": 2.5}}
