"""A file of at most 1 MiB costs at most a second of the processor and 512 MB, or is refused within them."""

import pytest
from robustness.heavy import is_costly, measured


@pytest.mark.filterwarnings("ignore")
def test_no_small_file_asks_for_more_than_a_second_or_512_mb():
    for name, found in measured():
        assert found["kind"] in ("fine", "refused"), (name, found)
        assert not is_costly(found), (name, found)
