"""The replay of an episode on a page."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from page_reader import columns, maps_of, plain_numbers, signed_numbers, unpacked

import lidarium
from lidarium.envs.drawing.prediction_layer import PredictionLayer
from lidarium.envs.settings.lidar import Lidar
from lidarium.envs.settings.making import make_settings
from lidarium.evaluation.episodes.runner import run_episode
from lidarium.evaluation.episodes.watching import WatchedExploration
from lidarium.evaluation.record import read_record, write_record
from lidarium.evaluation.record.replay import drive_again, rerun
from lidarium.evaluation.report.map_layers import changed_runs, coarse, packed, signed_varints, varints
from lidarium.evaluation.report.replay_page import (
    MOST_BEAMS,
    PROBABILITIES,
    SCAN_UNIT_M,
    ReplaySampler,
    replay_of,
)
from lidarium.evaluation.truth.beliefs import maps_on_floor
from lidarium.evaluation.truth.true_map import occupied_in_truth


@given(st.lists(st.integers(0, 2**35 - 1)))
def test_numbers_come_back(numbers):
    assert plain_numbers(varints(numbers)) == numbers


@given(st.lists(st.integers(-(2**34), 2**34 - 1)))
def test_numbers_with_a_sign_come_back(numbers):
    assert signed_numbers(signed_varints(numbers)) == numbers


def test_a_small_number_takes_one_byte():
    assert varints([0, 127]) == b"\x00\x7f"
    assert varints([128, 300]) == b"\x80\x01\xac\x02"  # the examples of the format's definition


@given(st.lists(st.lists(st.integers(0, 2), min_size=12, max_size=12), min_size=1, max_size=6))
def test_maps_come_back_sample_by_sample(samples):
    before, stream = np.zeros((3, 4), np.uint8), b""
    for sample in samples:
        after = np.array(sample, np.uint8).reshape(3, 4)
        stream += changed_runs(before, after)
        before = after
    assert np.array_equal(maps_of(stream, 3, 4), np.array(samples).reshape(-1, 3, 4))


def test_a_map_that_stays_takes_one_byte():
    levels = np.ones((50, 50), np.uint8)
    assert changed_runs(levels, levels) == b"\x00"


def test_a_run_of_cells_takes_few_bytes():
    before, after = np.zeros((10, 10), np.uint8), np.zeros((10, 10), np.uint8)
    after[2:4] = 1
    assert plain_numbers(changed_runs(before, after)) == [1, 20, 20, 1]


@pytest.mark.parametrize("words", ["plain", "</script><b>", "ü \u2028"])
def test_header_and_streams_come_back(words):
    text = packed({"name": words}, {"a": b"\x00\x01", "empty": b"", "b": b"<"})
    assert "<" not in text
    header, streams = unpacked(text)
    assert header["name"] == words
    assert streams == {"a": b"\x00\x01", "empty": b"", "b": b"<"}


def sampled(duration_s=5.0, **options):
    sampler = ReplaySampler(duration_s)
    settings = make_settings(**{"robots": 2, "resolution": 0.05, "horizon_s": 5.0, **options})
    env = WatchedExploration("apartment", settings, watchers=[sampler])
    run_episode(lidarium.policy("nearest_frontier"), env, 0)
    return sampler.finish(env), sampler, env


def test_maps_are_sampled_each_second_and_at_the_end_and_scans_more_often():
    samples, _, env = sampled()
    assert samples.map_times == pytest.approx([0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 5.0])
    assert samples.scan_times == pytest.approx(np.arange(0.0, 5.0, 0.4).tolist())
    assert env.scorer.time == pytest.approx(5.0)
    together = maps_on_floor(env).sum(axis=0, dtype=np.int16)[samples.grid.window]
    assert np.array_equal(samples.team.levels, coarse(together > 0, together < 0, samples.grid.block))
    assert len(samples.own) == 2


def test_samples_of_a_long_episode_are_further_apart():
    samples, _, _ = sampled(duration_s=1200.0)
    assert samples.map_times == pytest.approx([0.0, 2.0, 4.0, 5.0])
    assert samples.scan_times[1] == pytest.approx(0.8)


def test_a_lone_robot_has_no_map_beside_the_teams_and_true_poses_are_not_believed():
    samples, sampler, env = sampled(robots=1)
    assert samples.own == []
    assert samples.believed == []
    angles = sampler.beam_angles(env)
    assert len(angles) == samples.scans[0].shape[1] <= MOST_BEAMS
    assert angles[0] == pytest.approx(env.settings.lidar.angles[0], abs=1e-5)


def test_scans_of_lidars_that_differ_are_sampled_at_the_same_angles():
    near, wide = Lidar(beams=120, field_of_view=math.pi, range_max=2.0), Lidar(beams=120, field_of_view=2.0 * math.pi)
    samples, sampler, env = sampled(horizon_s=4.0, lidar=[near, wide])
    angles, last = np.array(sampler.beam_angles(env)), samples.scans[-1]
    assert np.array_equal(last[1], env.simulation.ranges[1, ::2])
    is_in_view = np.abs(angles) <= math.pi / 2 + 1e-3
    assert np.isinf(last[0, ~is_in_view]).all()
    nearest = np.abs(near.angles[None] - angles[is_in_view, None]).argmin(axis=1)
    assert np.array_equal(last[0, is_in_view], env.simulation.ranges[0, nearest])


@pytest.fixture(scope="module")
def apart(recorded):
    """Two robots that do not know each other's start, with noise, wheels that slip, and odometry alone."""
    return recorded(
        "explore_lite",
        known_starts=False,
        resolution=0.05,
        horizon_s=20.0,
        localization="odometry",
        noise="datasheet",
        odometry="poor",
    )


def levels_of(log_odds):
    return np.where(log_odds > 0, 2, np.where(log_odds < 0, 1, 0))


def in_page(levels, header, env):
    """Return the part of a map at 5 cm that the page shows."""
    grid, origin = header["grid"], env.world.floors[0].laser.origin
    row, column = round((grid["y"] - origin[1]) / 0.05), round((grid["x"] - origin[0]) / 0.05)
    return levels[row : row + grid["rows"], column : column + grid["columns"]]


def test_maps_at_the_end_are_those_of_the_robots(apart):
    record, env = apart
    header, streams = unpacked(replay_of(record).text)
    shape = header["grid"]["rows"], header["grid"]["columns"]
    maps = maps_on_floor(env)
    assert header["grid"]["cell"] == 0.05
    assert header["layers"] == ["team", "robot_0", "robot_1"]
    for name, log_odds in zip(header["layers"], [maps.sum(axis=0, dtype=np.int16), *maps], strict=True):
        samples = maps_of(streams[f"map_{name}"], *shape)
        assert np.array_equal(samples[-1], in_page(levels_of(log_odds), header, env))
        assert len(samples) == len(columns(streams["map_times"], 1))
        assert (samples[0] != samples[-1]).any()
    truth = maps_of(streams["truth"], *shape)[-1]
    assert np.array_equal(truth == 2, in_page(occupied_in_truth(env), header, env))


def test_every_sample_is_the_map_of_its_time(apart):
    """What changes far from a robot would be missed by windows that are too small."""
    record, _ = apart
    header, streams = unpacked(replay_of(record).text)
    times = columns(streams["map_times"], 1)[:, 0]
    samples = maps_of(streams["map_robot_1"], header["grid"]["rows"], header["grid"]["columns"])
    for place in (0, 7, 13):
        steps = round(times[place] / record.header["time_step"])
        part = replace(
            record,
            commands=record.commands[:steps],
            header={
                **record.header,
                "endings": [each for each in record.header["endings"] if each[0] <= steps],
            },
        )
        env = drive_again(part)
        assert np.array_equal(samples[place], in_page(levels_of(maps_on_floor(env)[1]), header, env))


def test_poses_scans_and_beliefs_are_those_of_the_episode(apart):
    record, env = apart
    header, streams = unpacked(replay_of(record).text)
    poses = columns(streams["poses"], 6).reshape(-1, 2, 3)
    turns = np.round((poses[..., 2] - record.display.poses[..., 2]) / (2.0 * math.pi))
    assert np.allclose(poses[..., :2], record.display.poses[..., :2], atol=6e-4)
    assert np.allclose(poses[..., 2] - 2.0 * math.pi * turns, record.display.poses[..., 2], atol=2e-3)
    assert np.allclose(columns(streams["pose_times"], 1)[:, 0], record.display.times)
    assert np.allclose(columns(streams["coverage"], 1, 1e-6)[:, 0], record.display.coverage[:, 1], atol=1e-6)
    beams = len(header["beam_angles"])
    ranges = np.cumsum(np.array(signed_numbers(streams["scans"])).reshape(-1, 2, beams), axis=-1) * SCAN_UNIT_M
    stride = -(-env.settings.lidar.beams // 60)
    last = env.simulation.ranges[:, ::stride]
    assert ranges.shape[0] == len(columns(streams["scan_times"], 1))
    assert np.allclose(np.where(np.isfinite(last), last, 0.0), ranges[-1], atol=SCAN_UNIT_M)
    assert np.allclose(header["beam_angles"], env.settings.lidar.angles[::stride], atol=1e-5)
    believed = columns(streams["believed"], 6).reshape(-1, 2, 3)
    assert np.allclose(believed[0], env.world.starts, atol=2e-3)
    assert np.hypot(*(believed[-1] - poses[-1])[:, :2].T).max() > 1e-3


def test_the_same_record_gives_the_same_replay(apart):
    record, _ = apart
    assert replay_of(record) == replay_of(record)


def test_a_record_of_another_version_shows_what_it_holds(apart):
    record, _ = apart
    other = replace(record, header={**record.header, "version": "9.9.9<b>"})
    replay = replay_of(other)
    assert "the record is of lidarium 9.9.9<b>" in replay.lacks
    header, streams = unpacked(replay.text)
    assert header["layers"] == ["team"]
    assert not header["has_truth"]
    assert header["lacks"] == replay.lacks
    samples = maps_of(streams["map_team"], header["grid"]["rows"], header["grid"]["columns"])
    assert len(samples) == len(record.display.changes.times)
    assert (samples[-1] == 1).sum() == (record.display.map_at(math.inf) == 255).sum()


def test_one_robot_has_no_map_beside_the_team_s(recorded):
    record, _ = recorded(robots=1, resolution=0.05, horizon_s=5.0)
    header, streams = unpacked(replay_of(record).text)
    assert header["layers"] == ["team"]
    assert "believed" not in streams
    assert rerun(record).scorer.time == header["duration_s"]


def test_events_are_plain_text_and_numbers(apart):
    record, _ = apart
    odd = [{"time_s": 1.0, "kind": "</script>", "agent": None, "what": ["a"], "x": float("nan")}]
    changed = replace(record, display=replace(record.display, events=odd))
    (event,) = unpacked(replay_of(changed).text)[0]["events"]
    assert event == {"time_s": 1.0, "kind": "</script>", "agent": None, "what": "['a']", "x": "nan"}


def test_a_replay_predicts_beyond_the_maps_if_robots_did_or_one_asks(recorded):
    plain, _ = recorded(resolution=0.05, horizon_s=6.0)
    predicting, _ = recorded("predicted_tours", resolution=0.05, horizon_s=6.0)
    older = replace(predicting, header={**predicting.header, "version": "9.9.9"})
    assert (plain.predicts, predicting.predicts) == (False, True)
    assert unpacked(replay_of(plain).text)[0]["prediction"] is None
    for record, is_asked in ((plain, True), (predicting, False), (older, False)):
        header, streams = unpacked(replay_of(record, predicts=is_asked).text)
        grid, about = header["grid"], header["prediction"]
        assert about["cells"] * grid["cell"] == pytest.approx(0.2)
        assert about["steps"] == PROBABILITIES
        squares = maps_of(streams["prediction"], about["rows"], about["columns"])
        maps = maps_of(streams["map_team"], grid["rows"], grid["columns"])
        assert len(squares) == len(maps) == len(columns(streams["map_times"], 1))
        cells = np.repeat(np.repeat(squares[-1], about["cells"], 0), about["cells"], 1)[
            : grid["rows"], : grid["columns"]
        ]
        assert cells.max() == PROBABILITIES
        assert np.isin(np.arange(1, PROBABILITIES), cells[maps[-1] == 0]).any()
        # The page has what the network says of its last map, but for changes that are too small to be shown.
        known = (maps[-1] == 2).astype(np.int8) - (maps[-1] == 1)
        found = PredictionLayer().squares(known, grid["cell"])[0]
        assert np.abs(PROBABILITIES * found - squares[-1]).max() <= 0.76


def test_a_record_says_whether_robots_predicted(recorded, tmp_path):
    record, _ = recorded("predicted_tours", resolution=0.05, horizon_s=1.0)
    write_record(tmp_path / "episode.npz", record)
    assert read_record(tmp_path / "episode.npz").predicts
    older = replace(record, header={key: value for key, value in record.header.items() if key != "predicts"})
    write_record(tmp_path / "older.npz", older)
    assert not read_record(tmp_path / "older.npz").predicts
    odd = replace(record, header={**record.header, "predicts": "yes"})
    write_record(tmp_path / "odd.npz", odd)
    with pytest.raises(ValueError, match="predicts 'yes'; want true or false"):
        read_record(tmp_path / "odd.npz")
