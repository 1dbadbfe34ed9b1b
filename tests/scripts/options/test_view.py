"""`lidarium run --view` shows a run while it goes; the run is the same as without it."""

import json
import re
import signal
import socket
import subprocess
import sys
import time
import urllib.request

import pytest

from lidarium.scripts.main import main

pytest.importorskip("viser", reason="viser is not installed: extra [viewer]")

RUN = ["run", "--robots", "2", "--map-resolution", "0.05", "--seed", "4"]
SHORT = [*RUN, "--horizon-s", "3"]
PROGRAM = "import sys; from lidarium.scripts.main import main; sys.exit(main())"
PATIENCE_S = 120.0

OF_THE_MACHINE = {"steps_per_s", "decision_ms", "tick_ms", "peak_mb"}
"""What of a result is of the clock and the memory, and differs from run to run."""


def figures(folder):
    result = json.loads((folder / "result.json").read_text())
    return {key: value for key, value in result.items() if key not in OF_THE_MACHINE}


def begin(*arguments):
    return subprocess.Popen(
        [sys.executable, "-c", PROGRAM, *map(str, arguments)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )


def address(process):
    """Read where a process shows its run."""
    while True:
        line = process.stderr.readline()
        assert line, "it has ended"
        found = re.search(r"the run is shown at (http://127\.0\.0\.1:\d+)", line)
        if found:
            return found.group(1)


def test_files_are_the_same_with_and_without_a_view(tmp_path, capsys):
    assert main([*SHORT, "--out", str(tmp_path / "without")]) == 0
    assert main([*SHORT, "--view", "--view-port", "0", "--json", "--out", str(tmp_path / "with")]) == 0
    captured = capsys.readouterr()
    assert re.search(r"the run is shown at http://127\.0\.0\.1:\d+", captured.err)
    assert json.loads(captured.out[captured.out.index("{") :])["seed"] == 4
    files = sorted(path.name for path in (tmp_path / "with").iterdir())
    assert files == sorted(path.name for path in (tmp_path / "without").iterdir())
    for name in files:
        if name.endswith(".pgm"):
            assert (tmp_path / "with" / name).read_bytes() == (tmp_path / "without" / name).read_bytes()
    assert figures(tmp_path / "with") == figures(tmp_path / "without")


@pytest.mark.parametrize(
    ("options", "complaint"),
    [
        (["--view", "--view-port", "70000"], "--view-port is 70000; want 0 to 65535"),
        (["--view-stay"], "--view-stay keeps the page of --view; want --view as well"),
    ],
)
def test_bad_options_are_refused_before_anything_is_written(tmp_path, capsys, options, complaint):
    assert main([*SHORT, *options, "--out", str(tmp_path / "out")]) == 2
    assert complaint in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_port_in_use_is_refused_before_anything_is_written(tmp_path, capsys):
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        port = other.getsockname()[1]
        arguments = [*SHORT, "--view", "--view-port", str(port), "--out", str(tmp_path / "out")]
        assert main(arguments) == 2
    assert f"port {port} of 127.0.0.1 cannot be used: Address already in use" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_missing_extra_is_named_before_anything_is_written(tmp_path, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "viser", None)
    assert main([*SHORT, "--view", "--out", str(tmp_path / "out")]) == 2
    assert 'pip install "lidarium[viewer]"' in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_an_interrupt_ends_a_viewed_run_and_keeps_what_it_found(tmp_path, number, code):
    process = begin(*RUN, "--horizon-s", 600, "--view", "--view-port", 0, "--out", tmp_path)
    address(process)
    while "explored" not in process.stderr.readline():
        pass
    process.send_signal(number)
    out, errors = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == code, errors
    assert "Traceback" not in errors
    assert "interrupted" in out
    assert json.loads((tmp_path / "result.json").read_text())["interrupted"] is True


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_page_that_stays_is_there_until_an_interrupt(tmp_path, number):
    process = begin(*SHORT, "--view", "--view-port", 0, "--view-stay", "--json", "--out", tmp_path)
    where = address(process)
    while "stays until Ctrl-C" not in process.stderr.readline():
        pass
    with urllib.request.urlopen(where, timeout=20.0) as answer:
        assert answer.status == 200
    assert (tmp_path / "result.json").exists()
    time.sleep(0.2)
    process.send_signal(number)
    out, errors = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 0, errors
    assert "Traceback" not in errors
    assert json.loads(out)["interrupted"] is False
