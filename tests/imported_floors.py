"""Files of small floors, and what is free on a floor."""

import cv2
import numpy as np
import yaml
from scipy import ndimage


def free_of(floor, resolution=0.05):
    return floor.raster(resolution, 0.2, 0.2).solid == 0


def connectivity(free):
    areas = np.bincount(ndimage.label(free)[0].ravel())[1:]
    return areas.max() / areas.sum()


def write_map(folder, levels, **changes):
    cv2.imwrite(str(folder / "map.png"), np.asarray(levels, np.uint8))
    header = {
        "image": "map.png",
        "resolution": 0.1,
        "origin": [0.0, 0.0, 0.0],
        "negate": 0,
        "occupied_thresh": 0.65,
        "free_thresh": 0.196,
    }
    (folder / "map.yaml").write_text(yaml.safe_dump({**header, **changes}))
    return folder / "map.yaml"


def room(rows=20, columns=30):
    """White with a black border, a closet in the upper left corner, and an unknown block at the right."""
    pixels = np.full((rows, columns), 254, np.uint8)
    pixels[[0, -1]] = pixels[:, [0, -1]] = 0
    pixels[5, :6] = pixels[:6, 5] = 0
    pixels[10:12, 20:22] = 205
    return pixels
