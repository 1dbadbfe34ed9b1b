import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml

from lidarium.mapping.files.map_files import read_ros_map, write_ros_map
from lidarium.mapping.kernels import compilation
from lidarium.scripts.commands import COMMANDS
from lidarium.scripts.commands.run import Run
from lidarium.scripts.main import main


def two_rooms(door=True):
    """Cells of 0.1 m: two rooms of 2 x 2 m side by side, joined by a door of 0.8 m; row 0 at the lowest y."""
    levels = np.zeros((22, 43), np.uint8)
    levels[1:21, 1:21] = 255
    levels[1:21, 22:42] = 255
    if door:
        levels[8:16, 21] = 255
    return levels


@pytest.fixture
def floor(tmp_path):
    return write_ros_map(tmp_path / "in", "rooms", two_rooms(), (0.0, 0.0, 0.0), 0.1)


def refused(arguments, capsys, tmp_path, *words):
    """Assert exit code 2, one clear line on standard error, nothing on standard output and nothing
    written."""
    out = tmp_path / "out"
    assert main([*arguments, *([] if "--out" in arguments else ["--out", str(out)])]) == 2
    told = capsys.readouterr()
    assert told.out == ""
    assert "Traceback" not in told.err
    for word in words:
        assert word in told.err
    assert not out.exists()
    assert not (tmp_path / "runs").exists()
    return told.err


def failing(run):
    """Return a command with the options of `run` that does something else."""

    def execute(command: Run):
        return run(command)

    return execute


def rewritten(path, **changes):
    header = yaml.safe_load(path.read_text())
    for key, value in changes.items():
        if value is None:
            del header[key]
        else:
            header[key] = value
    path.write_text(yaml.safe_dump(header))
    return str(path)


def test_help_names_the_commands(capsys):
    assert main(["--help"]) == 0
    told = capsys.readouterr().out
    assert all(
        name in told
        for name in ("run", "evaluate", "merge", "replay", "report", "reproduce", "floors", "bench", "show")
    )


def test_help_comes_without_loading_the_kernels():
    slow = ("numba", "cv2", "matplotlib")
    code = (
        "import sys; from lidarium.scripts.main import main; main(['--help']); print([name for name in "
        f"{slow} if name in sys.modules])"
    )
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert told.splitlines()[-1] == "[]"


@pytest.mark.parametrize(
    "command",
    [
        "run",
        "evaluate",
        "merge",
        "replay",
        "report",
        "reproduce",
        "floors list",
        "floors show",
        "floors generate",
        "floors import",
        "floors prepare",
        "bench",
        "show",
    ],
)
def test_every_command_has_seed_out_and_json(command, capsys):
    assert main([*command.split(), "--help"]) == 0
    told = capsys.readouterr().out
    assert all(option in told for option in ("--seed", "--out", "--json"))


def test_a_run_writes_its_figures_map_and_picture(floor, tmp_path, capsys):
    arguments = [
        "run",
        "--floor",
        str(floor),
        "--robots",
        "2",
        "--policy",
        "nearest_frontier",
        "--out",
        str(tmp_path / "out"),
    ]
    assert main(arguments) == 0
    told = capsys.readouterr()
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == [
        "map.pgm",
        "map.yaml",
        "result.json",
        "robot_0.pgm",
        "robot_0.yaml",
        "robot_1.pgm",
        "robot_1.yaml",
        "run.png",
        "transforms.json",
    ]
    result = json.loads((tmp_path / "out" / "result.json").read_text())
    assert result["coverage_final"] >= 0.99
    assert result["floor"] == "rooms"
    assert "robot_1" in told.out
    assert "covered" in told.out
    assert str(tmp_path / "out") in told.out


def test_a_team_is_supervised_where_nothing_is_said_and_its_decisions_are_written(floor, tmp_path, capsys):
    arguments = [
        "run",
        "--floor",
        str(floor),
        "--robots",
        "2",
        "--json",
        "--map-resolution",
        "0.05",
        "--out",
        str(tmp_path / "out"),
    ]
    assert main(arguments) == 0
    result = json.loads(capsys.readouterr().out)
    assert (result["policy"], result["localization"], result["realism"]) == ("supervised", "slam", "lab")
    lines = [json.loads(line) for line in (tmp_path / "out" / "decisions.jsonl").read_text().splitlines()]
    assert sum(line["event"] == "decision" for line in lines) == result["supervisor"]["decisions"]
    assert [line["time_s"] for line in lines] == sorted(line["time_s"] for line in lines)


def test_a_world_that_is_given_is_not_changed(floor, tmp_path, capsys):
    assert (
        main(
            [
                "run",
                "--floor",
                str(floor),
                "--robots",
                "2",
                "--json",
                "--noise",
                "none",
                "--out",
                str(tmp_path / "out"),
            ]
        )
        == 0
    )
    result = json.loads(capsys.readouterr().out)
    assert (result["policy"], result["localization"], result["realism"]) == ("supervised", "truth", "ideal")


def test_the_supervisors_tree_is_shown_and_drawn(tmp_path, capsys):
    assert main(["show", "supervisor", "--out", str(tmp_path)]) == 0
    assert "rule 3: go to another goal" in capsys.readouterr().out
    assert json.loads((tmp_path / "supervisor.json").read_text())["tree"]["test"] == "failed"
    assert cv2.imread(str(tmp_path / "supervisor.png")).shape[2] == 3


def test_the_map_of_a_run_lies_where_the_floor_lies(floor, tmp_path):
    assert main(["run", "--floor", str(floor), "--robots", "1", "--out", str(tmp_path / "out")]) == 0
    found = read_ros_map(tmp_path / "out" / "map.yaml")
    assert found.resolution == 0.025
    column, row = (int((value - corner) / 0.025) for value, corner in zip((1.05, 1.05), found.origin[:2], strict=True))
    assert found.levels[row, column] == 255
    column = int((2.15 - found.origin[0]) / 0.025)
    row = int((0.45 - found.origin[1]) / 0.025)
    assert (found.levels[row, column - 4 : column + 4] == 0).any()


def test_json_is_the_result_file_and_nothing_else(tmp_path, capsys):
    arguments = [
        "run",
        "--json",
        "--seed",
        "3",
        "--map-resolution",
        "0.05",
        "--out",
        str(tmp_path / "out"),
        "--horizon-s",
        "20",
    ]
    assert main(arguments) == 0
    told = capsys.readouterr().out
    assert told == (tmp_path / "out" / "result.json").read_text()
    assert json.loads(told)["seed"] == 3


def test_a_run_without_out_writes_below_runs(floor, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["run", "--floor", str(floor), "--robots", "1", "--seed", "5"]) == 0
    assert (tmp_path / "runs" / "rooms-nearest_frontier-5" / "result.json").exists()


def test_a_run_can_be_filmed(floor, tmp_path):
    assert (
        main(
            [
                "run",
                "--floor",
                str(floor),
                "--robots",
                "1",
                "--horizon-s",
                "4",
                "--video",
                "--out",
                str(tmp_path / "out"),
            ]
        )
        == 0
    )
    assert (tmp_path / "out" / "run.mp4").stat().st_size > 1000
    assert not [path for path in (tmp_path / "out").iterdir() if path.name.startswith(".")]


def test_a_run_starts_where_it_is_told(floor, tmp_path, capsys):
    starts = "1.0,1.0,0;3.2,1.0,1.57"
    assert (
        main(
            [
                "run",
                "--floor",
                str(floor),
                "--robots",
                "2",
                "--starts",
                starts,
                "--out",
                str(tmp_path / "out"),
            ]
        )
        == 0
    )


def test_a_missing_floor_is_refused(tmp_path, capsys):
    refused(["run", "--floor", str(tmp_path / "none.yaml")], capsys, tmp_path, "none.yaml")
    refused(["floors", "import", str(tmp_path / "none.png"), "--resolution", "0.1"], capsys, tmp_path, "none.png")


def test_what_is_not_an_image_is_refused(tmp_path, capsys):
    (tmp_path / "text.png").write_text("no pixels here")
    refused(
        ["run", "--floor", str(tmp_path / "text.png"), "--resolution", "0.1"],
        capsys,
        tmp_path,
        "text.png",
        "image",
    )


def test_an_image_without_a_scale_is_refused(tmp_path, capsys):
    cv2.imwrite(str(tmp_path / "plain.png"), two_rooms())
    refused(["run", "--floor", str(tmp_path / "plain.png")], capsys, tmp_path, "--resolution")


@pytest.mark.parametrize("resolution", ["0", "-0.1", "nan"])
def test_a_resolution_that_is_not_positive_is_refused(resolution, tmp_path, capsys, floor):
    cv2.imwrite(str(tmp_path / "plain.png"), two_rooms())
    refused(
        ["run", "--floor", str(tmp_path / "plain.png"), "--resolution", resolution],
        capsys,
        tmp_path,
        "resolution is",
        "positive",
    )
    refused(["run", "--map-resolution", resolution], capsys, tmp_path, "resolution")
    if resolution != "nan":
        refused(
            ["run", "--floor", rewritten(floor, resolution=float(resolution))],
            capsys,
            tmp_path,
            "resolution",
            "positive",
        )


def test_a_yaml_with_a_missing_key_is_refused(floor, tmp_path, capsys):
    refused(["run", "--floor", rewritten(floor, origin=None)], capsys, tmp_path, "no key origin")


@pytest.mark.parametrize("grey", [0, 255])
def test_an_image_of_one_colour_is_refused(grey, tmp_path, capsys):
    cv2.imwrite(str(tmp_path / "plain.png"), np.full((40, 40), grey, np.uint8))
    refused(
        ["run", "--floor", str(tmp_path / "plain.png"), "--resolution", "0.1"],
        capsys,
        tmp_path,
        "plain.png",
        "want",
    )


def test_a_start_inside_a_wall_is_refused(floor, tmp_path, capsys):
    refused(
        ["run", "--floor", str(floor), "--robots", "1", "--starts", "2.15,0.4,0"],
        capsys,
        tmp_path,
        "inside a wall",
    )


@pytest.mark.parametrize(("start", "told"), [("1.5,0,0", "inside a wall"), ("50,0,0", "start")])
def test_a_tree_towards_a_goal_does_not_start_in_a_wall_or_outside(start, told, tmp_path, capsys):
    arguments = ["run", "--floor", "srt_cluttered", "--robots", "1", "--policy", "srt", "--starts", start]
    refused(arguments, capsys, tmp_path, told)


def test_disconnected_starts_are_refused(tmp_path, capsys):
    levels = two_rooms(door=False)
    levels[10, 21] = 255  # too narrow for the robot
    path = write_ros_map(tmp_path / "in", "cells", levels, (0.0, 0.0, 0.0), 0.1)
    refused(
        ["run", "--floor", str(path), "--robots", "2", "--starts", "1,1,0;3.2,1,0"],
        capsys,
        tmp_path,
        "disconnected",
    )


@pytest.mark.parametrize("starts", ["1,1", "one,two,three", "1,1,0;2", "1,1,nan", ""])
def test_starts_that_cannot_be_read_are_refused(starts, tmp_path, capsys):
    refused(["run", "--robots", "1", "--starts", starts], capsys, tmp_path, "--starts")


def test_a_start_for_every_robot_is_wanted(tmp_path, capsys):
    refused(["run", "--robots", "2", "--starts", "2.5,4,0"], capsys, tmp_path, "1 starts for 2 robots")


def test_more_robots_than_fit_are_refused(floor, tmp_path, capsys):
    refused(["run", "--floor", str(floor), "--robots", "60"], capsys, tmp_path, "do not fit")


@pytest.mark.parametrize("robots", ["0", "-1", "65"])
def test_a_team_has_one_to_64_robots(robots, tmp_path, capsys):
    refused(["run", "--robots", robots], capsys, tmp_path, f"robots is {robots}")


def test_a_floor_larger_than_memory_is_refused(tmp_path, capsys):
    cv2.imwrite(str(tmp_path / "plain.png"), two_rooms())
    refused(["run", "--floor", str(tmp_path / "plain.png"), "--resolution", "100"], capsys, tmp_path, "cells")


def test_memory_that_runs_out_is_told_without_a_traceback(tmp_path, capsys, monkeypatch):
    def fail(command):
        raise MemoryError

    monkeypatch.setitem(COMMANDS._items, "run", failing(fail))
    refused(["run"], capsys, tmp_path, "memory")


def test_an_unknown_policy_is_refused_with_the_nearest_name(tmp_path, capsys):
    refused(["run", "--policy", "nearest_frontir"], capsys, tmp_path, "did you mean 'nearest_frontier'?")


@pytest.mark.parametrize("option", ["--robot", "--lidar", "--noise", "--floor"])
def test_unknown_names_are_refused(option, tmp_path, capsys):
    refused(["run", option, "nonsense"], capsys, tmp_path, "nonsense")


@pytest.mark.parametrize(
    "arguments", [["run", "--flor", "x"], ["run", "--robots", "many"], ["walk"], [], ["show", "nothing"]]
)
def test_unknown_options_are_refused(arguments, capsys, tmp_path):
    assert main(arguments) == 2
    assert capsys.readouterr().out == ""


@pytest.mark.parametrize(
    "option", ["--seed -1", "--horizon-s 0", "--stop-coverage 0", "--stop-coverage 1.5", "--video-speed 0"]
)
def test_numbers_out_of_range_are_refused(option, tmp_path, capsys):
    refused(["run", "--video", *option.split()], capsys, tmp_path, option.split()[1])


@pytest.mark.parametrize(
    "command", ["run", "floors list", "floors show apartment", "floors generate", "show robots", "bench"]
)
def test_an_out_that_cannot_be_written_is_refused_before_the_work(command, tmp_path, capsys):
    (tmp_path / "file").write_text("mine")
    for place in (tmp_path / "file", tmp_path / "file" / "below"):
        refused([*command.split(), "--out", str(place)], capsys, tmp_path, "cannot write to")
    assert (tmp_path / "file").read_text() == "mine"


def test_a_defect_of_ours_asks_for_a_report(capsys, monkeypatch):
    def fail(command):
        raise RuntimeError("a wheel came off")

    monkeypatch.setitem(COMMANDS._items, "run", failing(fail))
    assert main(["run"]) == 1
    told = capsys.readouterr()
    assert told.out == ""
    assert "Please report it" in told.err
    assert "a wheel came off" in told.err


def test_an_interrupt_out_of_compiled_code_is_no_defect(capsys, monkeypatch):
    def interrupted(command):
        raise SystemError("returned a result with an exception set") from KeyboardInterrupt()

    monkeypatch.setitem(COMMANDS._items, "run", failing(interrupted))
    assert main(["run"]) == 130
    assert capsys.readouterr().err.endswith("interrupted\n")


def start_endless_run(folder: Path, *options: str) -> "subprocess.Popen[str]":
    arguments = [
        "run",
        "--floor",
        "office:3",
        "--policy",
        "random_walk",
        "--stop-coverage",
        "1",
        "--robots",
        "1",
        *options,
    ]
    return subprocess.Popen(
        [
            sys.executable,
            "-c",
            "import sys; from lidarium.scripts.main import main; sys.exit(main())",
            *arguments,
            "--out",
            str(folder),
        ],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        # A test run in the background may ignore the signal, and hand that on.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
        env={**os.environ, "PYTHONUNBUFFERED": "1"},
    )


@pytest.mark.skipif(sys.platform == "win32", reason="no SIGINT for one process there")
def test_an_interrupted_run_keeps_its_finished_parts(tmp_path):
    folder = tmp_path / "out"
    with start_endless_run(folder, "--json") as process:
        assert process.stderr is not None
        assert "explored" in process.stderr.readline()
        process.send_signal(signal.SIGINT)
        told, errors = process.communicate(timeout=60)
    assert process.returncode == 130, errors
    result = json.loads(told)
    assert result == json.loads((folder / "result.json").read_text())
    assert result["interrupted"] is True
    assert result["ended_because"] == {"robot_0": None}
    names = ["map.pgm", "map.yaml", "result.json", "robot_0.pgm", "robot_0.yaml", "run.png"]
    assert sorted(path.name for path in folder.iterdir()) == names
    assert "Traceback" not in errors


def test_a_run_interrupted_before_it_begins_writes_nothing(tmp_path, capsys, monkeypatch):
    def interrupt(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr("lidarium.envs.faces.parallel.ExplorationEnv.reset", interrupt)
    assert main(["run", "--json", "--out", str(tmp_path / "out")]) == 130
    assert capsys.readouterr().out == ""
    assert not (tmp_path / "out").exists()


def test_a_reader_who_leaves_is_no_error(tmp_path):
    code = (
        "import sys, time; from lidarium.scripts.main import main; time.sleep(0.3); sys.exit(main(['show', "
        "'settings']))"
    )
    process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    process.stdout.close()
    errors = process.stderr.read()
    process.stderr.close()
    assert process.wait(timeout=30) == 0
    assert errors == b""


def test_show_tells_what_can_be_chosen(capsys):
    for what, word in (
        ("policies", "nearest_frontier"),
        ("robots", "kobuki"),
        ("lidars", "urg"),
        ("settings", "stop_coverage"),
    ):
        assert main(["show", what]) == 0
        assert word in capsys.readouterr().out
        assert main(["show", what, "--json"]) == 0
        assert word in json.dumps(json.loads(capsys.readouterr().out)[what])


@pytest.mark.parametrize("is_first_start", [False, True])
def test_the_first_start_tells_that_it_compiles(tmp_path, capsys, monkeypatch, is_first_start):
    monkeypatch.setattr(compilation, "is_cache_empty", lambda: is_first_start)
    assert main(["run", "--floor", str(tmp_path / "none.yaml")]) == 2
    assert ("compiling the kernels" in capsys.readouterr().err) == is_first_start


def test_a_run_on_a_floor_with_a_goal_ends_there(tmp_path, capsys):
    assert (
        main(
            [
                "run",
                "--floor",
                "srt_l_room",
                "--robots",
                "1",
                "--policy",
                "srt",
                "--out",
                str(tmp_path),
                "--json",
            ]
        )
        == 0
    )
    assert json.loads(capsys.readouterr().out)["ended_because"] == {"robot_0": "reached"}
