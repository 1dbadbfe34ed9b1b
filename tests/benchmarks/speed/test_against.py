import sys

import numpy as np
import pytest

from lidarium.benchmarks.speed import against


def test_two_checkouts_drive_in_turn_and_tell_their_times():
    found = against.times([sys.executable, sys.executable], threads=1, rounds=1, blocks=2)
    assert list(found) == list(against.KINDS)
    for seconds in found.values():
        assert seconds.shape == (2, 2)
        assert np.all(seconds > 0.0)


def test_a_python_without_lidarium_is_named(tmp_path):
    python = tmp_path / "python"
    python.write_text("#!/bin/sh\nexit 1\n")
    python.chmod(0o755)
    with pytest.raises(RuntimeError, match=str(python)):
        against.times([str(python)], threads=1, rounds=1, blocks=1)
