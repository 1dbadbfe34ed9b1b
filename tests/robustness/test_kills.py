"""A command that is killed, or whose workers are, goes on with nothing lost or there twice.

``LIDARIUM_KILLS=1000`` kills so many evaluations, and a hundredth of them trainings, at least four, which
take twenty seconds each; ``python -m robustness.kills`` does the same by hand.
"""

import os
import sys

import pytest
from robustness.kills import run_kills

COUNT = 3


@pytest.mark.skipif(sys.platform != "linux", reason="children are found by the files of Linux")
def test_nothing_is_lost_or_there_twice_after_kills():
    count = int(os.environ.get("LIDARIUM_KILLS", COUNT))
    tally = run_kills(count, seed=int(os.environ.get("LIDARIUM_FUZZ_SEED", "0")), episodes=12)
    assert tally.kills.total() >= count
    assert not tally.faults, tally.faults[:20]


@pytest.mark.skipif("LIDARIUM_KILLS" not in os.environ, reason="LIDARIUM_KILLS says how often to kill")
@pytest.mark.skipif(sys.platform != "linux", reason="children are found by the files of Linux")
def test_trainings_lose_nothing_to_kills():
    count = max(int(os.environ["LIDARIUM_KILLS"]) // 100, 4)
    tally = run_kills(count, seed=int(os.environ.get("LIDARIUM_FUZZ_SEED", "0")), trains=True)
    assert tally.kills.total() >= count
    assert not tally.faults, tally.faults[:20]
