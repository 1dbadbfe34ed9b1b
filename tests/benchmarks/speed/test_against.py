import os
import sys

import numpy as np
import pytest

from lidarium.benchmarks.speed import against


@pytest.mark.skipif(os.name == "nt", reason="the other one is a script of the shell")
def test_two_checkouts_drive_in_turn_and_tell_their_times(tmp_path):
    other, asked = tmp_path / "python", tmp_path / "asked"
    other.write_text(f'#!/bin/sh\nwhile read -r line; do echo "$line" >> {asked}; echo 7.5; done\n')
    other.chmod(0o755)
    found = against.times([sys.executable, str(other)], against.KINDS, threads=1, rounds=1, blocks=2)
    assert list(found) == list(against.KINDS)
    for seconds in found.values():
        assert seconds.shape == (2, 2)
        assert np.all(seconds[0] > 0.0)
        assert np.all(seconds[1] == 7.5)
    assert asked.read_text().splitlines() == [*(f"{kind} from 0" for kind in against.KINDS), *against.KINDS]


def test_a_python_without_lidarium_is_named(tmp_path):
    python = tmp_path / "python"
    python.write_text("#!/bin/sh\nexit 1\n")
    python.chmod(0o755)
    with pytest.raises(RuntimeError, match=str(python)):
        against.times([str(python)], against.KINDS, threads=1, rounds=1, blocks=1)
