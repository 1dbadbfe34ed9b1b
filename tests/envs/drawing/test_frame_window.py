"""A window that shows frames, where there is a display."""

import warnings

import numpy as np
import pytest
from matplotlib import pyplot

from lidarium.envs.drawing.frame_window import FrameWindow


def test_a_window_without_a_display_says_so_once():
    pyplot.switch_backend("agg")
    window = FrameWindow("title")
    frame = np.zeros((60, 80, 3), np.uint8)
    with pytest.warns(UserWarning, match="no display"):
        window.show(frame)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        window.show(frame)
        window.close()
        window.close()
