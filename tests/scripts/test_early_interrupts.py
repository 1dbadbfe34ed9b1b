"""Ctrl-C ends a command without a traceback, however early it comes."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

pytestmark = pytest.mark.skipif(os.name == "nt", reason="signals are sent as on Unix")

PROGRAM = """
import sys
from pathlib import Path
from lidarium_command import main
class Telling:
    def find_spec(self, name, path=None, target=None):
        Path(sys.argv.pop()).touch() if name == "{module}" else None
sys.meta_path.insert(0, Telling())
sys.exit(main())
"""
"""The command, which makes a file when it comes to import a module."""


@pytest.mark.parametrize("module", ["lidarium", "gymnasium", "numpy", "lidarium.scripts.main"])
@pytest.mark.parametrize("delay_s", [0.0, 0.03])
def test_an_interrupt_while_modules_are_imported_shows_no_traceback(tmp_path, module, delay_s):
    begun = tmp_path / "begun"
    process = subprocess.Popen(
        [sys.executable, "-c", PROGRAM.format(module=module), "show", "lidars", str(begun)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    ends = time.monotonic() + 60.0
    while not begun.exists() and time.monotonic() < ends:
        time.sleep(0.001)
    time.sleep(delay_s)
    process.send_signal(signal.SIGINT)
    _, told = process.communicate(timeout=60)
    assert process.returncode == 130, told
    assert told.strip() == "interrupted"


TEAM = ["--floors", "srt_l_room", "--policies", "random_walk", "--robots", "1", "--horizon-s", "60"]
MANY = ["--seeds", "500", "--workers", "2"]
PROGRAM_OF_WORKERS = "import sys; from lidarium_command import main; sys.exit(main())"


@pytest.mark.skipif(sys.platform != "linux", reason="children are found by the files of Linux")
@pytest.mark.parametrize("delay_s", [0.0, 0.1, 0.3])
def test_workers_that_have_just_begun_leave_an_interrupt_to_their_parent(tmp_path, delay_s):
    """A terminal sends Ctrl-C to all processes of a command."""
    process = subprocess.Popen(
        [sys.executable, "-c", PROGRAM_OF_WORKERS, "evaluate", *TEAM, *MANY, "--out", tmp_path / "out"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    children = Path(f"/proc/{process.pid}/task/{process.pid}/children")
    ends = time.monotonic() + 60.0
    while len(children.read_text().split()) < 2 and time.monotonic() < ends:  # one keeps track of resources
        time.sleep(0.001)
    time.sleep(delay_s)
    os.killpg(process.pid, signal.SIGINT)
    _, told = process.communicate(timeout=60)
    assert process.returncode == 130, told
    assert "Traceback" not in told
