"""Masks drawn by hand or at random, for tests of what maps are measured by."""

import numpy as np
from hypothesis.extra.numpy import arrays

masks = arrays(np.bool_, (6, 9))


def mask(text):
    """Read rows of # and . from top to bottom, row 0 last."""
    return np.array([[letter == "#" for letter in line] for line in text.split()])[::-1]
