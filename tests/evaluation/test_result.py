import json

import numpy as np
import pytest

import lidarium
from lidarium.envs.exploration import ExplorationEnv
from lidarium.envs.settings import ExplorationSettings, make_settings
from lidarium.evaluation.result import in_floor_frame, realism_of, result_of, settings_sha256, team_log_odds
from lidarium.evaluation.runner import run_episode

KEYS = {
    "floor": str, "robots": int, "policy": str, "backend": str, "localization": str, "realism": str, "seed": int, "interrupted": bool,
    "coverage_final": float, "time_s": float, "path_m": list, "overlap": float, "collisions": int, "ended_because": dict, "given_up": list,
    "ate_m": list, "iou_occupied": float, "merges": dict, "decision_ms": dict, "steps_per_s": float, "version": str, "floor_sha256": str,
    "settings_sha256": str,
}  # fmt: skip
MAY_BE_NONE = ("horizon_s", "t85_s", "t90_s", "t95_s", "t99_s")


def explored(on_decision=None, **options):
    env = ExplorationEnv("apartment", make_settings(**{"robots": 2, "resolution": 0.05, "horizon_s": 30.0, **options}))
    return run_episode(lidarium.policy("nearest_frontier"), env, 0, on_decision=on_decision, raise_interrupt=False)


def test_a_result_has_the_keys_of_the_design_and_is_json():
    result = json.loads(json.dumps(result_of(explored(), "nearest_frontier"), allow_nan=False))
    assert set(result) == {*KEYS, *MAY_BE_NONE}
    for key, kind in KEYS.items():
        assert isinstance(result[key], kind), key
    assert result["ended_because"] == {"robot_0": "horizon", "robot_1": "horizon"}
    assert result["merges"] == {"accepted": 0, "correct": 0, "false": 0, "first_correct_s": None}
    assert result["ate_m"] == [0.0, 0.0]
    assert result["realism"] == "ideal"
    assert result["time_s"] == 30.0
    assert result["interrupted"] is False
    for entry in result["given_up"]:
        assert set(entry) == {"agent", "x", "y", "size_m", "reason"}


def test_the_same_seed_gives_the_same_result_but_for_wall_time():
    first, second = (result_of(explored()) for _ in range(2))
    for wall in ("decision_ms", "steps_per_s"):
        del first[wall], second[wall]
    assert first == second


def test_thresholds_that_were_not_reached_are_none():
    result = result_of(explored(horizon_s=1.0))
    assert result["coverage_final"] < 0.85
    assert [result[key] for key in MAY_BE_NONE[1:]] == [None] * 4


def test_an_interrupted_run_has_a_result_and_robots_still_at_work():
    def interrupt(env):
        if env.scorer.time > 5.0:
            raise KeyboardInterrupt

    result = result_of(explored(interrupt))
    assert result["interrupted"] is True
    assert result["ended_because"] == {"robot_0": None, "robot_1": None}
    assert result["coverage_final"] > 0.0


def test_a_run_interrupted_before_its_start_has_no_result():
    episode = explored()
    episode.env.floor = None
    with pytest.raises(ValueError, match="before it began"):
        result_of(episode)


def test_noise_is_not_ideal():
    assert realism_of(make_settings(noise="datasheet")) == "custom"


def test_the_hash_of_settings_tells_all_that_matters_and_threads_do_not():
    assert settings_sha256(ExplorationSettings()) == settings_sha256(ExplorationSettings(threads=4))
    assert settings_sha256(ExplorationSettings()) != settings_sha256(ExplorationSettings(robots=2))


def test_the_team_map_is_the_same_wherever_the_robots_believe_to_start():
    turned = {"starts": np.array([(2.5, 4.0, 0.0), (8.4, 6.3, np.pi / 2)])}
    maps = []
    for known_starts in (True, False):
        env = ExplorationEnv("apartment", make_settings(robots=2, resolution=0.05, known_starts=known_starts))
        env.reset(seed=0, options=turned)
        maps.append(np.sign(team_log_odds(env)[0]))
    known, unknown = maps
    either = (known != 0) | (unknown != 0)
    assert (known == unknown)[either].mean() > 0.9


def test_positions_are_told_in_the_frame_of_the_floor():
    for known_starts in (True, False):
        env = ExplorationEnv("apartment", make_settings(robots=1, resolution=0.05, known_starts=known_starts))
        env.reset(seed=0, options={"starts": np.array([(2.5, 4.0, 0.5)])})
        x, y = env.perception.belief("robot_0").pose[:2]
        assert in_floor_frame(env, "robot_0", x, y) == pytest.approx((2.5, 4.0))
