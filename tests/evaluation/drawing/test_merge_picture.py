"""Merged maps in the colours of who saw what."""

import cv2
import numpy as np

from lidarium.evaluation.drawing.merge_picture import (
    SEVERAL,
    _coloured,
    save_merge_picture,
)
from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.merging.frame_tree import FrameTree
from lidarium.mapping.merging.fusion import FusedMap
from lidarium.mapping.merging.joining.merged_maps import Merged

RED, BLUE = (200, 0, 0), (0, 0, 100)


def test_walls_of_several_are_dark_and_of_one_in_its_colour():
    levels = np.array([[0, 0, 255, 127]], np.uint8)
    sources = np.array([[0b01, 0b11, 0b10, 0]], np.uint64)
    fused = FusedMap(levels, np.zeros((1, 4), np.float32), sources, (0.0, 0.0), 0.1)
    picture = _coloured(fused, [RED, BLUE])[0].tolist()
    assert picture == [list(RED), SEVERAL.tolist(), [191, 191, 216], [240, 240, 240]]


def test_maps_of_which_nothing_is_known_have_a_picture_that_says_so(tmp_path):
    merged = Merged({"a": np.full((5, 5), 127, np.uint8)}, 0.1, {}, FrameTree())
    save_merge_picture(tmp_path / "a.png", merged, {"a": Transform()})
    assert cv2.imread(str(tmp_path / "a.png")).shape[0] < 200
