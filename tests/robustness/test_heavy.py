"""A file of at most 1 MiB is read or refused without end of memory or time.

``python -m robustness.heavy`` measures what each takes: a second of the processor and 512 MB are the promise.
A slow or busy machine may take longer than a second, so the test only checks that reading ends.
"""

import pytest
from robustness.heavy import MOST_MB, measured

HANG_S = 60.0


@pytest.mark.filterwarnings("ignore")
def test_no_small_file_asks_for_more_than_512_mb_or_never_ends():
    for name, found in measured(most_s=HANG_S):
        assert found["kind"] in ("fine", "refused"), (name, found)
        assert found["mb"] <= MOST_MB, (name, found)
        assert found["cpu_s"] < HANG_S, (name, found)
