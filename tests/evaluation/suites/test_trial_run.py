"""One trial of a suite."""

import pytest
from small_pictures import RESOLUTION, save_room

from lidarium.envs.settings.making import make_settings
from lidarium.evaluation.record import read_record
from lidarium.evaluation.suites.suite import Suite
from lidarium.evaluation.suites.trial import Trial
from lidarium.evaluation.suites.trial_run import (
    RecordNotWrittenError,
    beside_bound,
    run_trial,
    write_record_bytes,
)

SETTINGS = {"horizon_s": 3.0, "resolution": 0.05}


def test_a_line_says_what_was_run_from_where(tmp_path):
    suite = Suite(
        policies=("nearest_frontier",),
        floors=("apartment",),
        variants={"short": SETTINGS},
        starts={"apartment": (((2.5, 4.0, 0.5),),)},
        stop={"decisions": 1},
    )
    (trial,) = suite.trials()
    line = run_trial(suite, trial, tmp_path)
    assert (line["key"], line["variant"]) == (trial.key, "short")
    assert line["starts"] == [[2.5, 4.0, 0.5]]
    assert line["ended_because"] == {"robot_0": "stop_rule"}
    assert line["decisions"] == 1
    assert 2.0 <= line["time_s"] < 2.2
    assert line["record"] == f"records/{trial.file_name}.npz"
    (path,) = tmp_path.iterdir()
    assert read_record(path).header["starts"] == [[2.5, 4.0, 0.5]]


@pytest.mark.parametrize(("share", "is_reached"), [(0.1, True), (0.9, False)])
def test_success_is_by_the_figure_of_the_rule(share, is_reached):
    suite = Suite(
        policies=("nearest_frontier",),
        floors=("apartment",),
        robots=(2,),
        variants={"apart": {**SETTINGS, "horizon_s": 20.0, "stop_coverage": 0.3, "radio": "line_of_sight"}},
        stop={"figure": "c_own_min", "at_least": share, "decisions": 5},
    )
    line = run_trial(suite, next(suite.trials()))
    assert (line["c_own_min_final"] >= share) is is_reached
    assert line["success"] is is_reached
    assert (line["coverage_final"] >= 0.3) is not is_reached


def test_without_a_folder_there_is_no_record():
    suite = Suite(policies=("random_walk",), floors=("apartment",), variants={"default": SETTINGS})
    (trial,) = suite.trials()
    line = run_trial(suite, trial)
    assert line["record"] is None
    assert "bound_s" not in line


def test_a_record_that_cannot_be_written_says_what_is_kept(tmp_path):
    write_record_bytes(tmp_path / "a.npz", b"abc")
    assert (tmp_path / "a.npz").read_bytes() == b"abc"
    with pytest.raises(RecordNotWrittenError, match="the episodes before are kept"):
        write_record_bytes(tmp_path / "a.npz" / "b.npz", b"abc")
    assert [path.name for path in tmp_path.iterdir()] == ["a.npz"]


pytest.importorskip("ortools", reason="OR-Tools is not installed")


def test_an_episode_is_as_many_times_slower_as_its_time_says(tmp_path):
    trial = Trial("default", save_room(tmp_path), 1, -1, 0, "nearest_frontier")
    settings = make_settings(robots=1, resolution=0.05)
    got_there, never = (
        beside_bound(trial, settings, {"starts": [[0.5, 1.5, 3.0]], "t99_s": time}, RESOLUTION) for time in (60.0, None)
    )
    assert 0.0 < got_there["bound_s"] < 60.0
    assert got_there["t99_over_bound"] == pytest.approx(60.0 / got_there["bound_s"], rel=1e-5)
    assert never == {"bound_s": got_there["bound_s"], "t99_over_bound": None}
