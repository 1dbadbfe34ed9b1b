"""Pictures of the episodes of a batch, all of one size, and tiled into one."""

import math
from collections.abc import Sequence

import numpy as np

from lidarium.envs.drawing.frame_parts import Frame, with_header
from lidarium.envs.drawing.rendering import Scene, draw_frame

TILE_SIZE = 320
"""Longer side of a floor in a tile [pixels]."""


def batch_frames(scenes: Sequence[Scene], size: int = TILE_SIZE) -> list[Frame]:
    """Draw scenes into pictures of one size, independent of the sizes of their floors.

    Returns
    -------
    list of (rows, columns, 3) uint8
        A picture for each; the area outside a floor is white.
    """
    shape = with_header(np.zeros((size, size, 3), np.uint8), "", 0.0, 0.0).shape
    return [_padded(draw_frame(scene, size), shape) for scene in scenes]


def _padded(frame: Frame, shape: tuple[int, ...]) -> Frame:
    """Return a frame at the upper left of a white picture."""
    canvas = np.full(shape, 255, np.uint8)
    canvas[: frame.shape[0], : frame.shape[1]] = frame[: shape[0], : shape[1]]
    return canvas


def tiled(frames: Sequence[Frame]) -> Frame:
    """Put pictures of one size side by side, in about as many rows as columns."""
    if not len(frames):
        raise ValueError("frames are empty; want at least one picture")
    columns = math.ceil(math.sqrt(len(frames)))
    rows = math.ceil(len(frames) / columns)
    height, width, depth = frames[0].shape
    canvas = np.full((rows * height, columns * width, depth), 255, np.uint8)
    for k, frame in enumerate(frames):
        top, left = k // columns * height, k % columns * width
        canvas[top : top + height, left : left + width] = frame
    return canvas
