"""Scans of a rectangular room, for tests of what tells where its walls run."""

import numpy as np

BEAMS = np.linspace(-2.0, 2.0, 241)
"""Directions of the beams [rad]."""


def room_seen(x, y, heading, noise, seed):
    """Points of a scan in a room of 6 m by 4 m, as the robot sees them."""
    cosine, sine = np.cos(BEAMS + heading), np.sin(BEAMS + heading)
    with np.errstate(divide="ignore", over="ignore"):
        to_side = np.where(cosine > 0.0, 6.0 - x, x) / np.abs(cosine)
        to_end = np.where(sine > 0.0, 4.0 - y, y) / np.abs(sine)
    ranges = np.minimum(to_side, to_end) + np.random.default_rng(seed).normal(scale=noise, size=len(BEAMS))
    return np.stack([np.cos(BEAMS) * ranges, np.sin(BEAMS) * ranges], axis=1)
