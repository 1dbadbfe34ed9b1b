"""Kernels that Python has called are listed, so that a first start compiles them."""

import numpy as np

from lidarium.evaluation.truth import map_counts
from lidarium.scripts.dev.list_kernels import called_kernels


def test_a_kernel_that_was_called_is_listed_where_it_stands():
    windows = np.zeros((1, 4), np.int64)
    map_counts.note_changes(windows, windows.copy())
    listed = called_kernels()
    signatures = {entry["name"]: entry["signature"] for entry in listed}
    names = list(signatures)
    assert len(signatures["lidarium.evaluation.truth.map_counts:note_changes"]) == 2
    # A kernel is listed by the module that holds it, not by those that import it.
    assert not [name for name in names if name.endswith(":note_changes") and "map_tally" in name]
