"""Kernels that Python has called are listed, so that a first start compiles them."""

import numpy as np

from lidarium.evaluation.record import recorder
from lidarium.evaluation.truth import map_tally
from lidarium.mapping.grids import map_deltas
from lidarium.scripts.dev.list_kernels import called_kernels


def test_a_kernel_that_was_called_is_listed_where_it_stands():
    windows = np.zeros((1, 4), np.int64)
    map_tally.note_changes(windows, windows.copy())
    listed = called_kernels({module.__name__: module for module in (map_tally, recorder, map_deltas)})
    signatures = {entry["name"]: entry["signature"] for entry in listed}
    names = list(signatures)
    assert len(signatures["lidarium.evaluation.truth.map_tally:note_changes"]) == 2
    # A kernel is listed by the module that holds it, not by those that import it.
    assert recorder.note_changes is map_deltas.note_changes
    assert not [name for name in names if name.startswith("lidarium.evaluation.record.recorder:")]
