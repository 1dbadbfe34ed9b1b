"""A campaign keeps what is finished, goes on where it stopped, and gives the same lines whoever does the
work."""

import json
import os
import shutil

import pytest

from lidarium.envs.floors.catalogue.names import load_floor
from lidarium.evaluation.record import read_record, rerun
from lidarium.evaluation.suites.campaign import Campaign, run_trial
from lidarium.evaluation.suites.episodes_file import TIMINGS, read_episodes
from lidarium.evaluation.suites.suite import Suite


def suite(**changes):
    settings = {"horizon_s": 6.0, "resolution": 0.05}
    plan = {
        "policies": ("nearest_frontier", "random_walk"),
        "floors": ("apartment",),
        "robots": (2,),
        "seeds": (0, 1),
    }
    return Suite(**{**plan, "variants": {"default": settings}, **changes})


def lasting(folder):
    lines = read_episodes(folder / "episodes.jsonl")
    return {line["key"]: {name: value for name, value in line.items() if name not in TIMINGS} for line in lines}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A finished campaign of four episodes."""
    folder = tmp_path_factory.mktemp("campaign")
    campaign = Campaign(suite(), folder)
    assert len(list(campaign.run())) == campaign.done == campaign.total == 4
    return folder


def test_a_folder_holds_the_suite_a_line_and_a_record_for_each_episode(folder):
    assert json.loads((folder / "suite.json").read_text())["policies"] == ["nearest_frontier", "random_walk"]
    lines = read_episodes(folder / "episodes.jsonl")
    assert {line["key"] for line in lines} == {trial.key for trial in suite().trials()}
    for line in lines:
        record = read_record(folder / line["record"])
        assert record.header["policy"] == line["policy"]
        assert record.header["settings_sha256"] == line["settings_sha256"]


def test_a_record_of_a_campaign_runs_again(folder):
    line = read_episodes(folder / "episodes.jsonl")[0]
    env = rerun(read_record(folder / line["record"]))
    assert round(env.scorer.coverage, 9) == line["coverage_final"]


def test_pairs_have_the_same_starts_and_seeds_other_ones(folder):
    starts = {(line["policy"], line["seed"]): line["starts"] for line in read_episodes(folder / "episodes.jsonl")}
    assert starts["nearest_frontier", 0] == starts["random_walk", 0] != starts["nearest_frontier", 1]


def test_two_workers_leave_the_same_lines_as_one(folder, tmp_path):
    campaign = Campaign(suite(), tmp_path, workers=2)
    assert len(list(campaign.run())) == 4
    assert lasting(tmp_path) == lasting(folder)


def test_a_campaign_goes_on_where_it_stopped_and_takes_more(folder, tmp_path):
    shutil.copytree(folder, tmp_path / "copy")
    path = tmp_path / "copy" / "episodes.jsonl"
    first = path.read_bytes().split(b"\n")[0]
    path.write_bytes(first + b"\n" + first[:40])
    with pytest.warns(UserWarning, match="cut off"):
        assert len(list(Campaign(suite(), tmp_path / "copy").run())) == 3
    assert lasting(tmp_path / "copy") == lasting(folder)
    more = Campaign(suite(seeds=(1, 2), policies=("nearest_frontier",)), tmp_path / "copy")
    assert len(list(more.run())) == 1
    assert json.loads((tmp_path / "copy" / "suite.json").read_text())["seeds"] == [0, 1, 2]


def test_what_a_killed_writer_left_is_cleared_away(folder, tmp_path):
    shutil.copytree(folder, tmp_path / "copy")
    (tmp_path / "copy" / "records" / ".half.npz.x7_a12bc").mkdir()
    (tmp_path / "copy" / "records" / ".git").mkdir()
    assert list(Campaign(suite(), tmp_path / "copy").run()) == []
    assert [path.name for path in (tmp_path / "copy" / "records").glob(".*")] == [".git"]


@pytest.mark.parametrize("workers", [1, 2])
def test_a_folder_that_is_removed_meanwhile_ends_the_campaign(tmp_path, workers):
    plan = suite(seeds=tuple(range(20)))
    campaign = Campaign(plan, tmp_path / "out", workers=workers)
    runs = campaign.run()
    next(runs)
    # Moved away at once: workers may write into the folder while it is emptied.
    (tmp_path / "out").rename(tmp_path / "removed")
    with pytest.raises(OSError, match="while episodes were written"):
        next(runs)
    assert not campaign.failures


@pytest.mark.parametrize("records", [True, False])
def test_a_full_disk_ends_the_campaign_at_its_first_write_and_the_next_goes_on(folder, tmp_path, monkeypatch, records):
    before, calls = os.fsync, []

    def full(handle):
        calls.append(handle)
        if len(calls) > 4:
            raise OSError(28, "No space left on device")
        before(handle)

    campaign = Campaign(suite(), tmp_path / "out", records=records)
    with monkeypatch.context() as patched:
        patched.setattr("os.fsync", full)
        with pytest.raises(OSError, match=r"No space.*goes on from there"):
            list(campaign.run())
    # The suite's file, then a record and a line for each episode, or a line.
    assert campaign.done == (1 if records else 3)
    assert len(calls) == 5
    assert len(list(Campaign(suite(), tmp_path / "out", records=records).run())) == 4 - campaign.done
    if records:
        assert lasting(tmp_path / "out") == lasting(folder)


@pytest.mark.parametrize("content", ["{}", "[1]", '{"name": "my bands"}', '{"version": "1"}'])
def test_a_suite_file_of_someone_else_is_refused_and_left(tmp_path, content):
    (tmp_path / "suite.json").write_text(content)
    with pytest.raises(ValueError, match="no evaluation has written it"):
        list(Campaign(suite(), tmp_path).run())
    assert (tmp_path / "suite.json").read_text() == content


@pytest.mark.parametrize("content", ["{}", "[1]", '{"1": 2}', "my notes"])
def test_a_file_of_errors_of_someone_else_is_refused_and_left(folder, tmp_path, content):
    shutil.copytree(folder, tmp_path / "copy")
    (tmp_path / "copy" / "failed.json").write_text(content)
    with pytest.raises(ValueError, match=r"failed\.json.*move it away"):
        list(Campaign(suite(), tmp_path / "copy").run())
    assert (tmp_path / "copy" / "failed.json").read_text() == content


def test_other_settings_and_other_versions_are_refused(folder, tmp_path):
    other = suite(variants={"default": {"horizon_s": 6.0, "resolution": 0.05, "noise": "datasheet"}})
    with pytest.raises(ValueError, match=r"noise = its default.*noise = datasheet"):
        list(Campaign(other, folder).run())
    with pytest.raises(ValueError, match="ended by the rule None"):
        list(Campaign(suite(stop={"decisions": 3}), folder).run())
    shutil.copytree(folder, tmp_path / "copy")
    path = tmp_path / "copy" / "episodes.jsonl"
    path.write_text(path.read_text().replace('"version":"', '"version":"9.'))
    with pytest.raises(ValueError, match=r"lidarium 9\..*this is"):
        list(Campaign(suite(), tmp_path / "copy").run())


def test_a_trial_that_fails_is_told_and_the_others_run(tmp_path):
    free = tuple(tuple(float(number) for number in start) for start in load_floor("apartment").starts[:2])
    solid = ((-9.0, -9.0, 0.0), (-8.0, -8.0, 0.0))
    campaign = Campaign(
        suite(policies=("nearest_frontier",), seeds=(0,), starts={"apartment": (free, solid)}), tmp_path
    )
    assert [line["starts"][0] for line in campaign.run()] == [[round(number, 6) for number in free[0]]]
    ((failed, error),) = campaign.failures
    assert (failed.start, type(error)) == (1, ValueError)
    assert json.loads((tmp_path / "failed.json").read_text()) == {failed.key: f"ValueError: {error}"}
    moved = suite(policies=("nearest_frontier",), seeds=(0,), starts={"apartment": (solid,)})
    with pytest.raises(ValueError, match="other starts on 'apartment'"):
        list(Campaign(moved, tmp_path).run())


def test_an_error_is_forgotten_when_its_episode_finishes(folder, tmp_path):
    shutil.copytree(folder, tmp_path / "copy")
    done = read_episodes(folder / "episodes.jsonl")[0]["key"]
    (tmp_path / "copy" / "failed.json").write_text(json.dumps({done: "ValueError: no"}))
    list(Campaign(suite(), tmp_path / "copy").run())
    assert not (tmp_path / "copy" / "failed.json").exists()


def test_a_rule_stops_an_episode_and_says_so():
    shares = [{"figure": figure, "at_least": 0.1} for figure in ("c_free", "c_known", "c_valid", "c_own_min")]
    for rule in (
        *shares,
        {"decisions": 2},
        {"figure": "c_free", "above": 0.2},
        {"figure": "remaining_cells", "at_most": 1e9},
    ):
        stopped = suite(stop=rule)
        line = run_trial(stopped, next(stopped.trials()))
        assert set(line["ended_because"].values()) == {"stop_rule"}
        assert line["time_s"] < 6.0


@pytest.mark.parametrize(
    ("rule", "message"),
    [
        ({"figure": "beauty", "above": 0.5}, "'beauty'; want one of"),
        ({"figure": "c_free"}, "with 0 bounds"),
        ({"figure": "c_free", "above": 0.5, "at_most": 1.0}, "with 2 bounds"),
        ({"decisions": 0}, "from 1 to"),
        ({}, "ends nothing"),
        ({"when": 3}, "no 'when'"),
    ],
)
def test_rules_that_are_not_clear_are_refused(rule, message):
    with pytest.raises(ValueError, match=message):
        suite(stop=rule)


def test_episodes_are_set_beside_what_a_team_that_knew_the_floor_needs(tmp_path):
    pytest.importorskip("ortools", reason="OR-Tools is not installed")
    suite = Suite(
        policies=("nearest_frontier", "tour_frontier"),
        floors=("apartment:3",),
        variants={"default": {"resolution": 0.1, "stop_coverage": 0.99, "horizon_s": 600.0}},
        bounds=True,
    )
    lines = list(Campaign(suite, tmp_path / "out", records=False).run())
    assert len({line["bound_s"] for line in lines}) == 1
    for line in lines:
        assert line["t99_over_bound"] == pytest.approx(line["t99_s"] / line["bound_s"], rel=1e-5)
        assert line["t99_over_bound"] > 1.0


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        (
            {"policy_settings": {"nearest_frontier": {"minimum_size": 3.0}}},
            "policy 'nearest_frontier' with other settings",
        ),
        ({"policy_settings": {"nearest_frontier": {"policy": "utility_frontier"}}}, "with other settings, {}"),
        ({"draws_starts": False}, "draws_starts = True, this one has False"),
        ({"bounds": True}, "bounds = False, this one has True"),
    ],
)
def test_episodes_of_another_request_are_not_taken_for_those_of_this_one(folder, tmp_path, changes, words):
    shutil.copytree(folder, tmp_path / "copy")
    with pytest.raises(ValueError, match=words):
        list(Campaign(suite(**changes), tmp_path / "copy").run())


def test_without_the_file_of_the_suite_rows_tell_of_another_rule(folder, tmp_path):
    shutil.copytree(folder, tmp_path / "copy")
    (tmp_path / "copy" / "suite.json").unlink()
    with pytest.raises(ValueError, match="holds episodes of nearest_frontier with other options, rules to stop"):
        list(Campaign(suite(stop={"decisions": 1}), tmp_path / "copy").run())
    other = suite(variants={"default": {"horizon_s": 60.0, "resolution": 0.05, "realism": "field"}})
    with pytest.raises(ValueError, match="of nearest_frontier in variant 'default' with other settings"):
        list(Campaign(other, tmp_path / "copy").run())


def test_given_starts_are_not_taken_for_drawn_ones(folder, tmp_path):
    shutil.copytree(folder, tmp_path / "copy")
    given = {"apartment": (((2.5, 4.0, 0.0), (3.5, 4.0, 0.0)),)}
    with pytest.raises(ValueError, match="other starts on 'apartment'"):
        list(Campaign(suite(starts=given), tmp_path / "copy").run())
