"""Rigid motions of space, of points with their normals and boxes."""

import itertools

import numpy as np
from numpy.typing import NDArray

_CORNERS = np.array(list(itertools.product((0, 1), repeat=3)))


def checked_poses(poses: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return poses (F, 4, 4) or (4, 4) as float64."""
    found = np.asarray(poses, np.float64)
    if found.shape[-2:] != (4, 4) or found.ndim > 3:
        raise ValueError(f"pose has shape {found.shape}; want (4, 4)")
    turns = found[..., :3, :3]
    is_turn = np.allclose(turns @ np.swapaxes(turns, -1, -2), np.eye(3), atol=1e-4)
    if not (np.isfinite(found).all() and is_turn and (np.linalg.det(turns) > 0.0).all()):
        raise ValueError("a pose is no rigid motion; want a rotation with a translation, in metres")
    if not np.allclose(found[..., 3, :], [0.0, 0.0, 0.0, 1.0]):
        raise ValueError("the last row of a pose is not 0, 0, 0, 1; want a rigid motion")
    return found


def inverse_of(poses: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the motions that undo others (..., 4, 4)."""
    undone = np.zeros(poses.shape)
    undone[..., :3, :3] = np.swapaxes(poses[..., :3, :3], -1, -2)
    undone[..., :3, 3] = -np.einsum("...ij,...j->...i", undone[..., :3, :3], poses[..., :3, 3])
    undone[..., 3, 3] = 1.0
    return undone


def moved_points(points: NDArray[np.float64], motions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return points (N, 3) moved by one motion (4, 4), or each by its own (N, 4, 4)."""
    return turned(points, motions) + motions[..., :3, 3]


def turned(directions: NDArray[np.float64], motions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return directions (N, 3) turned by one motion (4, 4), or by one each."""
    return np.asarray(np.einsum("...ij,...j->...i", motions[..., :3, :3], directions))


def moved_boxes(boxes: NDArray[np.float64], motions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the boxes along the axes that hold the moved corners of boxes.

    Parameters
    ----------
    boxes : (N, 2, 3) float64
        Low and high corners [m].
    motions : (N, 4, 4) float64
        How each is moved.

    Returns
    -------
    (N, 2, 3) float64
        Low and high corners [m].
    """
    corners = boxes[:, _CORNERS, np.arange(3)]
    places = np.einsum("nij,ncj->nci", motions[:, :3, :3], corners) + motions[:, None, :3, 3]
    return np.stack([places.min(axis=1), places.max(axis=1)], axis=1)
