"""`lidarium serve` answers on standard input and at a port, and ends as all commands do."""

import json
import os
import re
import signal
import subprocess
import sys

import pytest

from lidarium.scripts.commands.serve import PathClient
from lidarium.scripts.main import main

PROGRAM = "import sys; from lidarium.scripts.main import main; sys.exit(main())"
PATIENCE_S = 120.0
ENDS = {"start": [0.7, 1.8], "goal": [3.3, 1.8]}


def begin(*arguments):
    return subprocess.Popen(
        [sys.executable, "-c", PROGRAM, "serve", *map(str, arguments)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )


def test_requests_of_standard_input_are_answered_until_it_ends(room):
    process = begin(room / "maps" / "room.smap", "--radius", 0.2)
    lines = [{"id": 1, "method": "plan", **ENDS}, {"id": 2, "method": "plan", "start": [0.7, 1.8]}]
    told, errors = process.communicate("\n".join(map(json.dumps, lines)), PATIENCE_S)
    assert process.returncode == 0, errors
    plan, refused = map(json.loads, told.splitlines())
    assert plan["id"] == 1
    assert plan["length_m"] > 2.6  # the table stands between
    assert refused == {"id": 2, "error": "the request plan has no goal; want start, goal"}


@pytest.mark.skipif(os.name == "nt", reason="signals are sent as on Unix")
@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_server_at_a_port_ends_cleanly_by_a_signal(room, number, code):
    process = begin(room / "maps" / "room.smap", "--port", 0)
    port = 0
    while not port:
        line = process.stderr.readline()
        assert line, process.wait()
        port = int((re.search(r"at port (\d+)", line) or [0, 0])[1])
    with PathClient(port) as client:
        assert client.plan(**ENDS)["found"]
        process.send_signal(number)
        told, errors = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == code
    assert not told
    assert errors.splitlines() == ["interrupted"]


@pytest.mark.parametrize(
    ("arguments", "thing"),
    [(["--port", "70000"], "port is 70000"), (["--radius", "nan"], "radius"), (["--radius", "9"], "can stand at none")],
)
def test_bad_options_are_refused(room, arguments, thing, capsys):
    assert main(["serve", str(room / "maps" / "room.smap"), *arguments]) == 2
    assert thing in capsys.readouterr().err


def test_a_file_that_is_no_map_is_refused(tmp_path, capsys):
    (tmp_path / "no.smap").write_bytes(b"no map")
    assert main(["serve", str(tmp_path / "no.smap")]) == 2
    assert "no.smap" in capsys.readouterr().err
