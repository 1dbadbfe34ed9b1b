"""Damaged files and extreme settings end in a clear error, never in a signal or a hang.

``LIDARIUM_FUZZ=100000`` tries so many of each in place of the short form; ``python -m robustness.fuzz`` does
the same by hand.
"""

import os

import pytest
from robustness.fuzz import fuzz
from robustness.worker import file_case

COUNTS = {"files": 2000, "settings": 200}


@pytest.mark.parametrize("kind", COUNTS)
def test_nothing_but_clear_errors_comes_out(kind):
    count = int(os.environ.get("LIDARIUM_FUZZ", COUNTS[kind]))
    tally = fuzz(kind, count, seed=int(os.environ.get("LIDARIUM_FUZZ_SEED", "0")))
    assert not tally.faults, tally.faults[:20]
    assert kind == "settings" or not tally.costly, tally.costly[:20]
    assert sum(tally.kinds.values()) == count
    # Of the damaged some can still be read, and of the extreme some can be simulated.
    assert tally.kinds["fine"] > 0.05 * count
    assert tally.kinds["refused"] > 0.2 * count


def test_cases_leave_the_files_from_which_they_are_made(tmp_path):
    samples = [tmp_path / name for name in ("map.pgm", "map.yaml")]
    for sample in samples:
        sample.write_text("as it was made")
    (tmp_path / "folder").mkdir()
    for number in range(6):
        file_case(samples, tmp_path / "folder", 0, number)
        assert all(sample.read_text() == "as it was made" for sample in samples)
