"""The notes of a release are its section of the change log."""

import subprocess
import sys
from pathlib import Path

import lidarium

SCRIPT = Path(__file__).parents[1] / "scripts" / "dev" / "release_notes.py"


def run(*arguments):
    return subprocess.run([sys.executable, str(SCRIPT), *arguments], capture_output=True, text=True, check=False)


def test_the_notes_of_this_release_are_its_bullets_and_no_others():
    found = run(lidarium.__version__)
    assert found.returncode == 0
    assert found.stdout.startswith("### ")
    assert "## [" not in found.stdout
    assert found.stdout.count("\n- ") > 10


def test_a_release_that_was_not_made_is_told():
    found = run("9.9.9")
    assert found.returncode == 1
    assert f"has no release 9.9.9; it has {lidarium.__version__}" in found.stderr
