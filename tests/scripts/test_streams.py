"""Commands end quietly where their output is closed or nobody reads it, and say so where it cannot be
written."""

import json
import os
import subprocess
import sys

import pytest

pytestmark = pytest.mark.skipif(os.name == "nt", reason="streams are closed as on Unix")

PROGRAM = "import sys; from lidarium.scripts.main import main; sys.exit(main())"


def in_shell(line, *arguments):
    """Run a line of the shell in which ``"$@"`` is a command of lidarium."""
    command = [sys.executable, "-c", PROGRAM, *map(str, arguments)]
    return subprocess.run(["sh", "-c", line, "sh", *command], capture_output=True, text=True)


NO_OUTPUT, NO_ERRORS, NOTHING = '"$@" >&-', '"$@" 2>&-', '"$@" >&- 2>&- <&-'
ONE_LINE = '{ { "$@"; echo code $? >&3; } | head -1; } 3>&1'
NOBODY = '{ { "$@" 2>&1; echo code $? >&3; } | true; } 3>&1'


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        ("floors list", NO_ERRORS),
        ("floors list", ONE_LINE),
        ("--help", NOTHING),
        ("--help", NOBODY),
        ("show settings --json", NO_OUTPUT),
        ("show settings --json", ONE_LINE),
        ("show settings --json", NOBODY),
    ],
)
def test_closed_streams_and_readers_who_leave_are_no_error(line, arguments):
    told = in_shell(line, *arguments.split())
    assert told.returncode == 0
    assert told.stderr == ""
    assert "|" not in line or "code 0" in told.stdout.split("\n")


def test_errors_end_with_their_code_where_nobody_hears_them():
    assert in_shell('"$@" 2>&-', "run", "--floor", "none.yaml").returncode == 2
    assert in_shell('"$@" >&- 2>&-', "nonsense").returncode == 2


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="the system has no device that is always full")
def test_a_result_that_cannot_be_written_is_told():
    told = in_shell('"$@" >/dev/full', "show", "robots", "--json")
    assert told.returncode == 2
    assert "the result cannot be written: No space left on device" in told.stderr
    assert "Traceback" not in told.stderr


def test_files_are_not_mixed_with_what_is_told_where_streams_are_closed(tmp_path):
    told = in_shell('"$@" >&- 2>&-', "show", "robots", "--out", tmp_path)
    assert told.returncode == 0
    assert json.loads((tmp_path / "robots.json").read_text())["robots"]
