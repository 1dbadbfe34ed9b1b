"""A trial has a name of its own."""

from dataclasses import replace

from lidarium.evaluation.suites.trial import Trial

TRIAL = Trial("default", "maps/a.png", 2, -1, 7, "nearest_frontier")


def test_a_key_names_what_is_run():
    assert TRIAL.key == "default | maps/a.png | 2 | seed 7 | nearest_frontier"
    assert replace(TRIAL, start=0).key == "default | maps/a.png | 2 | seed 7 start 0 | nearest_frontier"


def test_a_file_name_is_safe_short_and_no_other_trials():
    trials = [
        TRIAL,
        replace(TRIAL, floor="maps-a.png"),
        replace(TRIAL, start=0),
        replace(TRIAL, floor="../" * 100 + "x"),
        replace(TRIAL, floor="B\u00fcro\udcff"),
    ]
    names = [trial.file_name for trial in trials]
    assert len(set(names)) == len(names)
    for name in names:
        assert not set("/\\ |:") & set(name)
        assert len(name) <= 160
