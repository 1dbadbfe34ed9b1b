"""The runs of supervised teams in their folder."""

import json
from pathlib import Path
from typing import Any

from lidarium.benchmarks.studies.supervisor.figures import Row
from lidarium.evaluation.suites.campaign import EPISODES_FILE
from lidarium.evaluation.suites.episodes_file import KEY, read_episodes

FAILING, LOGS_FILE, ASKED_FILE = "failing", "logs.json", "asked.json"
"""The suite of robots that fail, and the files of kept logs and of what was asked for last."""


def read_runs(folder: Path) -> list[Row]:
    """Return all runs in a folder."""
    return list(read_episodes(folder / EPISODES_FILE))


def asked_runs(folder: Path, name: str) -> list[Row]:
    """Return the runs of a suite that were asked for last. The folder may hold more, of a call for a larger share."""
    keys = read_json(folder / ASKED_FILE).get(name)
    return [row for row in read_runs(folder / name) if keys is None or row[KEY] in keys]


def read_json(path: Path) -> dict[str, Any]:
    """Return what a file holds; nothing if there is none."""
    return dict(json.loads(path.read_text(encoding="utf-8"))) if path.exists() else {}
