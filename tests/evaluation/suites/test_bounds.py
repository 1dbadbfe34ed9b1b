"""Episodes stand beside what a team that knew the floor needs."""

import pytest
from small_pictures import RESOLUTION, save_room

from lidarium.envs.settings.making import make_settings
from lidarium.evaluation.suites.bounds import beside_bound
from lidarium.evaluation.suites.trial import Trial

pytest.importorskip("ortools", reason="OR-Tools is not installed")


def test_an_episode_is_as_many_times_slower_as_its_time_says(tmp_path):
    trial = Trial("default", save_room(tmp_path), 1, -1, 0, "nearest_frontier")
    settings = make_settings(robots=1, resolution=0.05)
    got_there, never = (
        beside_bound(trial, settings, {"starts": [[0.5, 1.5, 3.0]], "t99_s": time}, RESOLUTION)
        for time in (60.0, None)
    )
    assert 0.0 < got_there["bound_s"] < 60.0
    assert got_there["t99_over_bound"] == pytest.approx(60.0 / got_there["bound_s"], rel=1e-5)
    assert never == {"bound_s": got_there["bound_s"], "t99_over_bound": None}
