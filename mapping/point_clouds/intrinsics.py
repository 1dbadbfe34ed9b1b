"""Pinhole cameras: what makes points of depth images."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class Intrinsics:
    """Focal lengths and principal point of a pinhole camera.

    Attributes
    ----------
    fx, fy : float
        Focal lengths [pixels].
    cx, cy : float
        Principal point [pixels]; the centre of the first pixel is (0, 0), as ROS and OpenCV have it.
    """

    fx: float
    fy: float
    cx: float
    cy: float

    def __post_init__(self) -> None:
        numbers = (self.fx, self.fy, self.cx, self.cy)
        if not np.isfinite(numbers).all() or self.fx <= 0.0 or self.fy <= 0.0:
            raise ValueError(
                f"intrinsics fx, fy, cx, cy are {numbers}; want finite numbers, fx and fy above 0"
            )


def points_of_depth(depth: NDArray[np.floating], intrinsics: Intrinsics) -> NDArray[np.float32]:
    """Return the points of a depth image in the camera's optical frame.

    Parameters
    ----------
    depth : (rows, columns) or (1, rows, columns) float
        Depths along the axis [m]; 0, nan and inf are no measurement.
    intrinsics : Intrinsics
        Of the camera.

    Returns
    -------
    (points, 3) float32
        x to the right, y down, z along the axis [m], row by row of the image.

    Raises
    ------
    ValueError
        Where the image has another shape.
    """
    image = np.asarray(depth)
    if image.ndim == 3 and image.shape[0] == 1:
        image = image[0]
    if image.ndim != 2:
        raise ValueError(f"depth has shape {np.shape(depth)}; want (rows, columns) or (1, rows, columns)")
    rows, columns = np.nonzero(np.isfinite(image) & (image > 0.0))
    z = image[rows, columns].astype(np.float64)
    x = (columns - intrinsics.cx) / intrinsics.fx * z
    y = (rows - intrinsics.cy) / intrinsics.fy * z
    return np.stack([x, y, z], axis=1).astype(np.float32)
