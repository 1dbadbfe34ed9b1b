"""What can be chosen: every list, and that listing compiles nothing."""

import json
import os
import subprocess
import sys
from typing import get_args, get_type_hints

import pytest

from lidarium.envs.settings.table import markdown_table
from lidarium.registry import registry
from lidarium.scripts.commands.show import Show
from lidarium.scripts.main import main

KINDS = {
    "policies": "policy",
    "robots": "robot",
    "lidars": "lidar",
    "realism": "realism",
    "odometry": "odometry",
    "radios": "radio",
    "batteries": "battery",
    "formats": "floor_format",
    "studies": "study",
    "rewards": "reward_term",
    "backends": "backend",
}


def choices():
    hint = get_type_hints(Show, include_extras=True)["what"]
    return get_args(get_args(hint)[0])


@pytest.mark.parametrize("what", choices())
def test_every_list_is_printed_as_text_and_as_json(what, capsys):
    assert main(["show", what]) == 0
    text = capsys.readouterr().out
    assert main(["show", what, "--json"]) == 0
    listed = json.loads(capsys.readouterr().out)
    assert listed
    if what in KINDS:
        names = list(registry(KINDS[what]))
        assert set(next(iter(listed.values()))) == set(names)
        assert all(name in text for name in names)


def test_the_table_of_settings_is_written_for_the_documentation(tmp_path):
    assert main(["show", "settings", "--out", str(tmp_path)]) == 0
    assert (tmp_path / "settings.md").read_text() == markdown_table()


def test_listing_compiles_nothing(tmp_path):
    commands = [["floors", "list"], *(["show", what] for what in choices())]
    code = f"from lidarium.scripts.main import main\nfor command in {commands}: assert main(command) == 0"
    subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)},
        stdout=subprocess.DEVNULL,
        check=True,
    )
    assert not list(tmp_path.rglob("*.nbi"))
