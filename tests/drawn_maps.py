"""Maps for the tests of merging: drawn rooms, and floors as seen by robots that start at different places."""

import cv2
import numpy as np

from lidarium.mapping.files.map_files import FREE, OCCUPIED, UNKNOWN
from lidarium.mapping.geometry.rigid import Transform

RESOLUTION = 0.05
SPREAD = 320


def blank(rows=160, columns=200):
    return np.full((rows, columns), UNKNOWN, np.uint8)


def room(levels, row, column, rows, columns, wall=2):
    """Draw free space with walls around it; row and column of the first free cell."""
    levels[row - wall : row + rows + wall, column - wall : column + columns + wall] = OCCUPIED
    levels[row : row + rows, column : column + columns] = FREE
    return levels


def apartment():
    """Five rooms of different sizes with doors, niches and a column, 9.4 m by 7.6 m, drawn large."""
    levels = blank(180, 220)
    room(levels, 10, 10, 60, 70)
    room(levels, 10, 83, 45, 105)
    room(levels, 73, 10, 75, 48)
    room(levels, 58, 83, 40, 60)
    room(levels, 101, 61, 47, 127)
    for box in (
        (30, 80, 50, 83),
        (55, 110, 58, 128),
        (70, 20, 73, 38),
        (120, 58, 140, 61),
        (98, 100, 101, 118),
    ):
        levels[box[0] : box[2], box[1] : box[3]] = FREE
    for box in (
        (10, 45, 22, 58),
        (38, 150, 46, 170),
        (90, 40, 112, 50),
        (130, 100, 136, 112),
        (101, 170, 115, 188),
        (10, 120, 16, 124),
    ):
        levels[box[0] : box[2], box[1] : box[3]] = OCCUPIED
    return levels


def moved(levels, new_from_old, shape=(SPREAD, SPREAD), resolution=RESOLUTION):
    """Return a map drawn anew in a frame of its own."""
    old_from_new = new_from_old.inverse()
    rows, columns = np.indices(shape)
    points = old_from_new.apply(np.stack([columns + 0.5, rows + 0.5], axis=-1) * resolution)
    cells = np.floor(points / resolution).astype(int)
    inside = (cells >= 0).all(axis=-1) & (cells[..., 0] < levels.shape[1]) & (cells[..., 1] < levels.shape[0])
    result = np.full(shape, UNKNOWN, np.uint8)
    result[inside] = levels[cells[inside][:, 1], cells[inside][:, 0]]
    return result


def kept(levels, rows, columns):
    """Return a map of which only a part is known."""
    result = np.full_like(levels, UNKNOWN)
    result[rows, columns] = levels[rows, columns]
    return result


def noisy(levels, seed, share=0.1):
    """Return a map whose walls are a cell thicker or thinner here and there, as noise of ranges makes
    them."""
    generator = np.random.default_rng(seed)
    wall = (levels == OCCUPIED).astype(np.uint8)
    beside = (cv2.dilate(wall, np.ones((3, 3), np.uint8)) > 0) & (levels == FREE)
    result = levels.copy()
    result[beside & (generator.random(levels.shape) < share)] = OCCUPIED
    return result


def about_middle(theta, levels, shape=(SPREAD, SPREAD), shift=(0.0, 0.0)):
    """Return the transform that turns a map about its middle into the middle of a larger one, shifted [m]."""
    middle = np.array([levels.shape[1], levels.shape[0]]) * RESOLUTION / 2.0
    target = np.array([shape[1], shape[0]]) * RESOLUTION / 2.0 + shift
    x, y = target - Transform(0.0, 0.0, theta).apply(middle)
    return Transform(float(x), float(y), theta)


def hall():
    """Ten rooms, 18 m by 7.6 m: the apartment and its mirror image, with a door between."""
    other = apartment()[::-1].copy()
    other[20:34, 20:40] = OCCUPIED
    other[120:128, 160:176] = OCCUPIED
    levels = np.hstack([apartment()[:, :190], other[:, 8:]])
    levels[105:123, 184:196] = FREE
    return levels


def sagging(points, sag, length):
    """Return how far points (n, 2) of a bowed map lie from where they belong [m]."""
    return np.stack([np.zeros(len(points)), sag * np.sin(np.pi * points[:, 0] / length)], axis=1)


def bowed(levels, sag, resolution=RESOLUTION):
    """Return a map whose middle is moved along y, as a map is that has drifted [m]."""
    rows, columns = np.indices(levels.shape)
    points = np.stack([columns + 0.5, rows + 0.5], axis=-1).reshape(-1, 2) * resolution
    there = points - sagging(points, sag, levels.shape[1] * resolution)
    cells = np.floor(there / resolution).astype(int)
    inside = (cells >= 0).all(axis=1) & (cells[:, 0] < levels.shape[1]) & (cells[:, 1] < levels.shape[0])
    result = np.full(levels.size, UNKNOWN, np.uint8)
    result[inside] = levels[cells[inside, 1], cells[inside, 0]]
    return result.reshape(levels.shape)
