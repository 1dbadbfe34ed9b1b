"""Odometry that is set to zero goes on."""

import numpy as np

from lidarium.mapping.files.mending.odometry_jumps import without_jumps


def test_odometry_that_is_set_to_zero_goes_on(tmp_path):
    stamps = 0.5 * np.arange(100.0)
    true = np.stack([0.2 * np.arange(100.0), np.zeros(100), np.zeros(100)], axis=1)
    reset = true.copy()
    reset[60:, 0] -= reset[60, 0]
    mended, jumps = without_jumps(reset, stamps)
    assert jumps == 1
    np.testing.assert_allclose(mended, true, atol=1e-9)
    for steady in (true, true * 10.0):
        unchanged, jumps = without_jumps(steady, stamps)
        assert jumps == 0
        assert unchanged is steady
