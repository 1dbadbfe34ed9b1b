import gzip
import json
from dataclasses import replace

import numpy as np
import pytest
from driven_rooms import GEOMETRY, driven, odd_room
from polygon_scans import distances_to

from lidarium.mapping.files.laser_logs import LaserLog
from lidarium.mapping.files.log_files import read_log
from lidarium.mapping.files.map_files import read_ros_map
from lidarium.mapping.files.npz_logs import write_npz_log
from lidarium.mapping.files.spline_files import read_spline_map
from lidarium.mapping.files.trajectories import read_tum, write_tum
from lidarium.mapping.geometry.rigid import composed, relative
from lidarium.mapping.localization.slam.following import run_slam
from lidarium.scripts.main import main

FILES = ["map.pgm", "map.yaml", "slam.json", "trajectory.tum"]
START_S = 1000.0


@pytest.fixture(scope="module")
def run():
    return driven(odd_room(), [(1.0, 1.0), (4.5, 1.0), (4.5, 2.4)])


@pytest.fixture(scope="module")
def log(run, tmp_path_factory):
    """A recording of the run, with its true trajectory and relations beside it."""
    folder = tmp_path_factory.mktemp("recording")
    stamps = START_S + np.array([sensing.time_s for sensing in run.sensings])
    ranges = np.stack([sensing.ranges for sensing in run.sensings])
    odometry = np.stack([sensing.odometry for sensing in run.sensings])
    write_npz_log(folder / "run.npz", LaserLog(stamps, ranges, GEOMETRY, odometry))
    write_tum(folder / "true.tum", stamps, run.truth)
    motions = relative(run.truth[:-20], run.truth[20:])
    rows = [f"{a} {b} {m[0]} {m[1]} 0 0 0 {m[2]}\n" for a, b, m in zip(stamps[:-20], stamps[20:], motions, strict=True)]
    (folder / "true.relations").write_text("".join(rows))
    return folder / "run.npz"


def test_a_recording_becomes_map_trajectory_and_figures(run, log, tmp_path, capsys):
    options = ["--reference", str(log.parent / "true.tum"), "--relations", str(log.parent / "true.relations")]
    assert main(["slam", str(log), "--out", str(tmp_path / "out"), "--json", *options]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result == json.loads((tmp_path / "out" / "slam.json").read_text())
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == FILES
    assert result["scans"] == len(run.sensings)
    assert result["ate_m"] < 0.03
    assert result["rpe_m"] < 0.05
    assert result["relations"]["relations"] == len(run.sensings) - 20
    assert result["relations"]["translation_m"] < 0.04
    assert result["settings"]["submaps"]["resolution"] == 0.05
    assert result["odometry"] is True
    assert (result["remarks"], result["probably_wrong"]) == ([], False)
    stamps, poses = read_tum(tmp_path / "out" / "trajectory.tum")
    assert stamps[0] == START_S
    assert np.hypot(*(poses - run.truth)[:, :2].T).max() < 0.1
    levels = read_ros_map(tmp_path / "out" / "map.yaml").levels
    assert 80 < levels.shape[0] < 140
    assert (levels == 0).sum() > 200


def test_the_robots_poses_are_told_wherever_its_laser_is(run, log, tmp_path, capsys):
    with np.load(log) as archive:
        arrays = dict(archive)
    mounting = np.array([0.2, 0.0, 0.3])
    robot = composed(arrays["pose_odom"], relative(mounting, np.zeros(3)))
    np.savez(tmp_path / "turned.npz", **{**arrays, "pose_odom": robot, "laser_pose": mounting})
    assert main(["slam", str(tmp_path / "turned.npz"), "--out", str(tmp_path / "out")]) == 0
    _, poses = read_tum(tmp_path / "out" / "trajectory.tum")
    true = composed(composed(mounting, run.truth), relative(mounting, np.zeros(3)))
    assert np.hypot(*(poses - true)[:, :2].T).max() < 0.1


def carmen(run, count=60):
    lines = []
    for sensing in run.sensings[:count]:
        numbers = [
            *np.nan_to_num(sensing.ranges, posinf=80.0).round(3)[30:211],
            *[0.0] * 3,
            *sensing.odometry,
            sensing.time_s,
        ]
        lines.append(f"FLASER 181 {' '.join(map(str, numbers))} host {sensing.time_s}\n")
    return lines


def test_a_carmen_log_with_damage_is_used_as_far_as_it_goes(run, tmp_path, capsys):
    lines = carmen(run)
    (tmp_path / "run.log.gz").write_bytes(
        gzip.compress("".join([*lines[:30], "WIND 3\n", "FLASER 181 1\n", lines[3], *lines[30:]]).encode())
    )
    assert main(["slam", str(tmp_path / "run.log.gz"), "--out", str(tmp_path / "out")]) == 0
    told = capsys.readouterr()
    assert "1 WIND lines" in told.err
    assert "1 damaged FLASER lines" in told.err
    assert "1 repeated scans" in told.err
    assert json.loads((tmp_path / "out" / "slam.json").read_text())["scans"] == 60


def test_a_log_without_odometry_is_matched_all_the_same(run, log, tmp_path, capsys):
    with np.load(log) as archive:
        arrays = dict(archive)
    np.savez(tmp_path / "blind.npz", **{**arrays, "pose_odom": np.zeros_like(arrays["pose_odom"])})
    arguments = ["--out", str(tmp_path / "out"), "--reference", str(log.parent / "true.tum")]
    assert main(["slam", str(tmp_path / "blind.npz"), *arguments]) == 0
    assert "no odometry" in capsys.readouterr().err
    result = json.loads((tmp_path / "out" / "slam.json").read_text())
    assert result["odometry"] is False
    assert result["ate_m"] < 0.1


def test_a_map_that_is_probably_wrong_is_written_with_a_sentence_a_remark_and_exit_code_4(log, tmp_path, capsys):
    with np.load(log) as archive:
        arrays = dict(archive)
    np.savez(tmp_path / "stretched.npz", **{**arrays, "ranges": arrays["ranges"] * 1.5, "max_range": 9.0})
    assert main(["slam", str(tmp_path / "stretched.npz"), "--out", str(tmp_path / "out")]) == 4
    (sentence,) = [line for line in capsys.readouterr().err.splitlines() if "probably wrong" in line]
    assert "this map is probably wrong: lengths by scans are 1." in sentence
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == FILES
    result = json.loads((tmp_path / "out" / "slam.json").read_text())
    assert result["probably_wrong"] is True
    assert result["remarks"][-1] in sentence


def test_a_field_of_view_that_is_only_assumed_ends_in_doubt(shared_cases, tmp_path, capsys):
    log = str(shared_cases / "flaser-geometry" / "fov270_silent.log.gz")
    assert main(["slam", log, "--range", "8", "--out", str(tmp_path / "out")]) == 4
    told = capsys.readouterr().err
    assert "136 beams, as no SICK has" in told
    assert "--field-of-view 27" in told
    assert "this map is probably wrong: turns by scans" in told
    assert main(["slam", log, "--range", "8", "--field-of-view", "270", "--out", str(tmp_path / "out")]) == 0


def test_odometry_that_stops_is_told_from_when_to_when(shared_cases, tmp_path, capsys):
    log = str(shared_cases / "odometry-stops" / "silent_8s.log.gz")
    assert main(["slam", log, "--range", "8", "--out", str(tmp_path / "out")]) == 0
    sentence = "odometry stands still while the scans move, from 1036.600 to 1044.600 s: 40 scans"
    assert sentence in capsys.readouterr().err
    assert sentence in json.loads((tmp_path / "out" / "slam.json").read_text())["remarks"][0]


@pytest.mark.parametrize("name", ["aces", "belgioioso", "edmonton", "intel"])
def test_maps_of_good_logs_are_not_doubted(shared_data, name):
    log = read_log(shared_data / "laser_logs" / "carmen" / f"{name}-corrected.log.gz")
    assert not log.remarks
    half = len(log.stamps) // 2
    log = replace(log, stamps=log.stamps[:half], ranges=log.ranges[:half], odometry=log.odometry[:half])
    found = run_slam(log)
    assert found.slam.counts.matches > 0.99 * half - 2
    assert found.slam.counts.closures > 3
    assert found.reasons_to_doubt == ()


def test_a_log_with_too_little_in_common_from_scan_to_scan_ends_in_doubt(shared_data, tmp_path, capsys):
    log = shared_data / "laser_logs" / "carmen" / "orebro-corrected.log.gz"
    scans = [line for line in gzip.decompress(log.read_bytes()).splitlines(True) if line.startswith(b"FLASER")]
    (tmp_path / "first.log").write_bytes(b"".join(scans[:60]))
    assert main(["slam", str(tmp_path / "first.log"), "--out", str(tmp_path / "out")]) == 4
    assert "scans are doubtful" in capsys.readouterr().err


def test_the_log_of_mines_is_read(shared_data):
    log = read_log(shared_data / "laser_logs" / "mines" / "exp1.dat.gz")
    assert (len(log.stamps), log.skipped, log.remarks) == (756, {}, ())
    found = run_slam(log)
    assert found.slam.counts.failures == 0
    assert found.reasons_to_doubt == ()


def test_the_same_log_gives_the_same_trajectory_to_the_bit(log, tmp_path, capsys):
    for name in "ab":
        assert main(["slam", str(log), "--out", str(tmp_path / name), "--seed", "3"]) == 0
    for name in ("trajectory.tum", "map.pgm"):
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()


@pytest.mark.parametrize(
    ("content", "word"),
    [
        (b"", "no scans"),
        (b"ODOM 0 0 0 0 0 0 1 h 1\n", "no scans"),
        (b"FLASER 3 80 80 80 0 0 0 0 0 0 1 h 1\n", "no scan with a return"),
    ],
)
def test_logs_without_anything_to_map_are_refused(content, word, tmp_path, capsys):
    (tmp_path / "run.log").write_bytes(content)
    assert main(["slam", str(tmp_path / "run.log"), "--out", str(tmp_path / "out")]) == 2
    assert word in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (["--resolution", "0"], "resolution is 0"),
        (["--range", "nan"], "range is nan"),
        (["--match-angle", "-1"], "match-angle"),
        (["--clock-shift", "inf"], "clock-shift"),
        (["--reference", "gone.tum"], "no file gone.tum"),
        (["--relations", "gone.relations"], "no file gone.relations"),
        (["--clock-shift", "1e6", "--reference", "TRUE"], "want times in common"),
        (["--clock-shift", "1e6", "--relations", "RELATIONS"], "with --clock-shift, which is 1000000.0"),
    ],
)
def test_bad_options_are_named_before_the_log_is_followed(log, arguments, word, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("lidarium.mapping.localization.slam.following.follow", None)
    files = {"TRUE": log.parent / "true.tum", "RELATIONS": log.parent / "true.relations"}
    arguments = [str(files.get(argument, argument)) for argument in arguments]
    assert main(["slam", str(log), *arguments, "--out", str(tmp_path / "out")]) == 2
    told = capsys.readouterr()
    assert word in told.err
    assert "Traceback" not in told.err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("localizer", ["splines", "splines_ekf"])
def test_a_log_is_followed_on_walls_as_splines(run, log, tmp_path, capsys, localizer):
    options = ["--localizer", localizer, "--reference", str(log.parent / "true.tum")]
    assert main(["slam", str(log), "--out", str(tmp_path / "out"), "--json", *options]) == 0
    result = json.loads(capsys.readouterr().out)
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == [*FILES[:3], "splines.npz", FILES[3]]
    assert result["ate_m"] < 0.05
    assert result["settings"]["localizer"] == localizer
    walls = read_spline_map(tmp_path / "out" / "splines.npz")
    assert len(walls.curves) == result["curves"]
    room = odd_room() - [1.0, 1.0, 1.0, 1.0]  # as seen from where the robot begins
    perimeter = np.hypot(*(room[:, 2:] - room[:, :2]).T).sum()
    assert 0.7 * perimeter < walls.length < 1.2 * perimeter
    assert np.quantile(distances_to(room, walls.sample()), 0.9) < 0.05
    levels = read_ros_map(tmp_path / "out" / "map.yaml").levels
    assert 80 < levels.shape[0] < 140


def test_a_log_begins_with_the_spline_map_of_another_run(log, tmp_path, capsys):
    first, second = tmp_path / "first", tmp_path / "second"
    assert main(["slam", str(log), "--localizer", "splines", "--out", str(first)]) == 0
    known = first / "splines.npz"
    capsys.readouterr()
    options = ["--localizer", "splines", "--start-map", str(known), "--reference", str(log.parent / "true.tum")]
    assert main(["slam", str(log), "--out", str(second), "--json", *options]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["ate_m"] < 0.05
    # The same walls again make no second ones.
    assert result["wall_m"] == pytest.approx(read_spline_map(known).length, rel=0.1)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--start-map", "a.npz"], "--start-map is a.npz and the localizer slam; want --localizer splines"),
        (["--localizer", "splines", "--ignore-odometry"], "want --localizer slam"),
        (["--localizer", "splines", "--match-angle", "1"], "--match-angle is set and the localizer splines; want"),
        (["--localizer", "splines", "--start-map", "missing.npz"], "there is no file missing.npz"),
        (["--clock-shift", "5"], "--clock-shift is given, but there is neither --reference nor --relations"),
        (["--relation-poses", "before"], "--relation-poses is given, but there are no --relations"),
        (["--topic", "/scan"], "topic is '/scan' for"),
        (["--field-of-view", "90"], "leave it out"),
    ],
)
def test_options_that_do_not_fit_the_localizer_are_refused(log, tmp_path, options, message, capsys):
    assert main(["slam", str(log), "--out", str(tmp_path / "out"), *options]) == 2
    assert message in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_localizer_on_splines_refuses_a_log_without_odometry(log, tmp_path, capsys):
    with np.load(log) as archive:
        arrays = {name: array for name, array in archive.items() if name != "pose_odom"}
    np.savez(tmp_path / "bare.npz", **arrays)
    assert main(["slam", str(tmp_path / "bare.npz"), "--localizer", "splines", "--out", str(tmp_path / "out")]) == 2
    assert "has no odometry, which splines needs" in capsys.readouterr().err


def test_scans_too_far_apart_for_splines_make_the_result_doubtful(log, tmp_path, capsys):
    with np.load(log) as archive:
        arrays = dict(archive)
    arrays["pose_odom"] = arrays["pose_odom"] * [20.0, 20.0, 1.0]
    np.savez(
        tmp_path / "wide.npz", **{name: _every_tenth(array, len(arrays["stamp"])) for name, array in arrays.items()}
    )
    out = tmp_path / "out"
    assert main(["slam", str(tmp_path / "wide.npz"), "--localizer", "splines", "--out", str(out), "--json"]) == 4
    told = capsys.readouterr()
    (remark,) = json.loads(told.out)["remarks"]
    assert "more than 0.3 m apart" in remark
    assert remark in told.err


def _every_tenth(array, count):
    return array[::10] if array.shape[:1] == (count,) else array


def test_a_localizer_on_splines_refuses_odometry_that_stops(shared_cases, tmp_path, capsys):
    log = shared_cases / "odometry-stops" / "stops_at_half.log.gz"
    assert main(["slam", str(log), "--localizer", "splines", "--out", str(tmp_path / "out")]) == 2
    assert f"{log} has no odometry at" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_seed_draws_other_particles(log, tmp_path):
    found = []
    for name, seed in (("first", "0"), ("again", "0"), ("other", "7")):
        out = tmp_path / name
        main(["slam", str(log), "--localizer", "splines", "--seed", seed, "--out", str(out)])
        found.append((out / "trajectory.tum").read_bytes())
    assert found[0] == found[1] != found[2]
