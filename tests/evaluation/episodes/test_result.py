import json

import numpy as np
import pytest

import lidarium
from lidarium.envs.faces.merged_maps import MergingSettings
from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.settings.making import make_settings
from lidarium.evaluation.episodes.events import in_floor_frame
from lidarium.evaluation.episodes.history import History
from lidarium.evaluation.episodes.result import result_of
from lidarium.evaluation.episodes.runner import run_episode
from lidarium.evaluation.episodes.watching import WatchedExploration
from lidarium.evaluation.metrics.progress import path_lengths
from lidarium.evaluation.suites.episodes_file import TIMINGS

KEYS = {
    "floor": str,
    "robots": int,
    "policy": str,
    "backend": str,
    "localization": str,
    "realism": str,
    "seed": int,
    "interrupted": bool,
    "coverage_final": float,
    "time_s": float,
    "success": bool,
    "path_m": list,
    "path_balance": float,
    "overlap": float,
    "collisions": int,
    "ended_because": dict,
    "given_up": list,
    "ate_m": list,
    "c_known_final": float,
    "c_valid_final": float,
    "c_own_min_final": float,
    "c_own_mean_final": float,
    "balance": float,
    "iou_occupied": float,
    "f1_occupied": float,
    "free_error_rate": float,
    "merges": dict,
    "operating": list,
    "decision_ms": dict,
    "peak_mb": float,
    "steps_per_s": float,
    "version": str,
    "floor_sha256": str,
    "settings_sha256": str,
}
AT_THRESHOLDS = [name.format(share) for name in ("t{}_s", "d{}_m", "d_sum{}_m", "n{}") for share in (85, 90, 95, 99)]
OVER_TIME = ["overlap_eb", "overlap_mx_85", "overlap_mx_95", "overlap_mv", "rpe_m", "rpe_rad"]
MAY_BE_NONE = [
    "horizon_s",
    "energy_j",
    "decided_by",
    "supervisor",
    "tick_ms",
    "c_others_final",
    "auc",
    "collisions_per_km",
    "closest_approach_m",
    "speed_at_closest_m_s",
    "near_misses",
    "time_near_people_s",
    "speed_near_people_m_s",
    "contacts_by_robot",
    "contacts_by_person",
    "yielding_s",
    *AT_THRESHOLDS,
    *OVER_TIME,
]


def explored(on_decision=None, **options):
    env = ExplorationEnv("apartment", make_settings(**{"robots": 2, "resolution": 0.05, "horizon_s": 30.0, **options}))
    return run_episode(lidarium.policy("nearest_frontier"), env, 0, on_decision=on_decision, raise_interrupt=False)


def watched(on_decision=None, **options):
    """An episode and its result with a history."""
    history = History()
    settings = make_settings(**{"robots": 2, "resolution": 0.05, "horizon_s": 30.0, **options})
    env = WatchedExploration("apartment", settings, watchers=[history])
    episode = run_episode(lidarium.policy("nearest_frontier"), env, 0, on_decision=on_decision, raise_interrupt=False)
    return episode, history, result_of(episode, history=history)


@pytest.mark.parametrize("known_starts", [True, False])
def test_merges_by_given_frames_are_right_whichever_frame_poses_are_believed_in(known_starts):
    history, merging = History(), MergingSettings(known_starts=True)
    settings = make_settings(robots=2, resolution=0.05, horizon_s=3.0, known_starts=known_starts)
    env = WatchedExploration("apartment", settings, watchers=[history])
    episode = run_episode(lidarium.policy("nearest_frontier"), env, 0, merging=merging)
    merges = result_of(episode, history=history)["merges"]
    assert (merges["accepted"], merges["wrong"]) == (1, 0)
    assert merges["worst_here_m"] == pytest.approx(0.0, abs=1e-6)


def test_a_result_has_the_keys_of_the_design_and_is_json():
    result = json.loads(json.dumps(result_of(explored(), "nearest_frontier"), allow_nan=False))
    assert set(result) == {*KEYS, *MAY_BE_NONE}
    for key, kind in KEYS.items():
        assert isinstance(result[key], kind), key
    assert result["ended_because"] == {"robot_0": "horizon", "robot_1": "horizon"}
    counts = dict.fromkeys(("accepted", "correct", "false", "off", "wrong"), 0)
    nothing = dict.fromkeys(("worst_m", "worst_rad", "worst_here_m", "worst_here_rad", "first_correct_s"))
    assert result["merges"] == {**counts, **nothing}
    assert result["ate_m"] == [0.0, 0.0]
    assert result["realism"] == "ideal"
    assert result["time_s"] == 30.0
    assert result["interrupted"] is False
    for entry in result["given_up"]:
        assert set(entry) == {"agent", "x", "y", "size_m", "reason"}


def test_the_same_seed_gives_the_same_result_but_for_wall_time():
    first, second = (result_of(explored()) for _ in range(2))
    for key in set(TIMINGS) & set(first):
        del first[key], second[key]
    assert first == second


def test_thresholds_that_were_not_reached_are_none():
    result = result_of(explored(horizon_s=1.0))
    assert result["coverage_final"] < 0.85
    assert [result[key] for key in AT_THRESHOLDS] == [None] * 16
    assert result["success"] is False


def test_a_history_fills_the_figures_over_time_and_changes_no_other():
    without, (_, _, result) = result_of(explored(horizon_s=90.0)), watched(horizon_s=90.0)
    assert set(without) == set(result)
    changed = {key for key in without if without[key] != result[key]} - set(TIMINGS)
    assert changed <= {*AT_THRESHOLDS, *OVER_TIME}
    assert all(without[key] is None for key in changed)
    assert result["t90_s"] is not None
    assert 0.0 < result["d85_m"] <= result["d90_m"] <= result["d_sum90_m"] <= sum(result["path_m"])
    assert 0 < result["n85"] <= result["n90"]
    assert 0.0 < result["overlap_mx_85"] < 1.0
    assert 0.0 < result["overlap_mv"] < 1.0
    assert result["rpe_m"] == result["rpe_rad"] == [0.0, 0.0]


@pytest.mark.parametrize("known_starts", [True, False])
def test_true_poses_have_no_error_in_either_frame(known_starts):
    _, _, result = watched(horizon_s=5.0, known_starts=known_starts)
    assert result["ate_m"] == result["rpe_m"] == [0.0, 0.0]


def test_the_path_to_a_threshold_is_the_one_driven_by_then():
    episode, history, result = watched(horizon_s=90.0)
    [milestone] = [milestone for milestone in history.milestones if milestone.time_s == result["t85_s"]]
    times = [time for time, _ in episode.env.scorer.track]
    driven = path_lengths(np.stack([pose for time, pose in episode.env.scorer.track if time <= milestone.time_s]))
    assert result["d85_m"] == pytest.approx(driven.max(), abs=0.1)
    assert result["d_sum85_m"] == pytest.approx(driven.sum(), abs=0.2)
    assert len(times) == len(history.believed)


def test_success_is_the_coverage_that_stops_the_run():
    _, _, result = watched(stop_coverage=0.5)
    assert result["success"] is True
    assert result["ended_because"] == {"robot_0": "covered", "robot_1": "covered"}
    assert watched(horizon_s=None, stop_coverage=0.5)[2]["auc"] is None


def test_robots_that_share_a_map_hold_the_same_and_others_their_own():
    shared, own = (watched(horizon_s=20.0, known_starts=known_starts)[2] for known_starts in (True, False))
    assert shared["c_own_min_final"] == shared["c_own_mean_final"] > own["c_own_mean_final"] > own["c_own_min_final"]


def test_walls_that_cannot_be_touched_are_no_error_of_f1_though_they_are_of_iou():
    """In the ideal world all that a map holds is true; what lies off F is not wanted, but it is not wrong."""
    _, _, result = watched(horizon_s=90.0)
    assert result["f1_occupied"] > result["iou_occupied"] > 0.8
    assert result["free_error_rate"] < 0.01


def test_an_interrupted_run_has_a_result_and_robots_still_at_work():
    def interrupt(env):
        if env.scorer.time > 5.0:
            raise KeyboardInterrupt

    _, history, result = watched(interrupt)
    assert history.curves.times[-1] > 5.0
    assert result["interrupted"] is True
    assert result["ended_because"] == {"robot_0": None, "robot_1": None}
    assert result["coverage_final"] > 0.0


def test_a_run_interrupted_before_its_start_has_no_result():
    episode = explored()
    episode.env.floor = None
    with pytest.raises(ValueError, match="before it began"):
        result_of(episode)


def test_a_history_that_has_not_begun_is_none():
    result = result_of(explored(horizon_s=1.0), history=History())
    assert result["overlap_mv"] is None


def test_positions_are_told_in_the_frame_of_the_floor():
    for known_starts in (True, False):
        env = ExplorationEnv("apartment", make_settings(robots=1, resolution=0.05, known_starts=known_starts))
        env.reset(seed=0, options={"starts": np.array([(2.5, 4.0, 0.5)])})
        x, y = env.belief("robot_0").pose[:2]
        assert in_floor_frame(env, "robot_0", x, y) == pytest.approx((2.5, 4.0))
