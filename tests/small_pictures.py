"""Pictures of small floors, as files."""

import cv2
import numpy as np

RESOLUTION = 0.05
"""Metres per pixel."""


def save_room(folder, width=4.0, height=3.0):
    """Write a room of a size [m] with walls of one pixel around it; return the file's name."""
    picture = np.zeros((round(height / RESOLUTION) + 2, round(width / RESOLUTION) + 2), np.uint8)
    picture[1:-1, 1:-1] = 255
    path = str(folder / "room.png")
    cv2.imwrite(path, picture)
    return path
