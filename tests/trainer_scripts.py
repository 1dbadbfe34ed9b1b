"""The scripts of ``docs/how_to/trainers``, for tests that run them for some steps."""

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import pytest

SCRIPTS = Path(__file__).parents[1] / "docs" / "how_to" / "trainers"

ROOM = {"floor": "scene_room", "threads": 1, "horizon_s": 8.0}
"""Short episodes on a small floor."""

RLLIB_NEEDS = "tree"
"""A library of RLlib's that Ray alone does not bring."""


def script(name: str, needs: str, extra: str) -> ModuleType:
    """Return a script as a module; the test is skipped where the trainer is not installed."""
    wanted = (needs, RLLIB_NEEDS) if needs == "ray" else (needs,)
    if any(importlib.util.find_spec(each) is None for each in wanted):
        pytest.skip(f"{needs} is not installed: extra [{extra}]")
    if str(SCRIPTS) not in sys.path:  # trainers pickle what a script defines, by its name
        sys.path.append(str(SCRIPTS))
    return importlib.import_module(name)
