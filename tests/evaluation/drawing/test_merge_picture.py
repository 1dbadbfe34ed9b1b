"""Pictures of merged maps."""

import cv2
import numpy as np
import pytest
from drawn_maps import RESOLUTION, about_middle, bowed, hall, moved, sagging

from lidarium.evaluation.drawing.merge_picture import (
    SEVERAL,
    _coloured,
    contradicting,
    panels_of,
    save_merge_picture,
)
from lidarium.mapping.files.images import read_image
from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.grids.occupancy import OCCUPIED
from lidarium.mapping.merging.frame_tree import FrameTree
from lidarium.mapping.merging.fusion import FusedMap
from lidarium.mapping.merging.joining import Merged
from lidarium.mapping.merging.merger import merge_maps

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


SAG = 0.5


@pytest.fixture(scope="module")
def bowed_merge():
    """A hall joined with its bowed copy, and where that lies."""
    there = about_middle(0.8, hall(), (480, 480))
    copied = moved(bowed(hall(), SAG), there, (480, 480))
    merged = merge_maps({"straight": (hall(), RESOLUTION), "bowed": (copied, RESOLUTION)})
    (group,) = merged.groups()
    assert group == ["straight", "bowed"]
    return merged, merged.deformed(group), there.inverse()


def test_a_bowed_copy_is_drawn_as_it_was_bent(bowed_merge):
    merged, deformed, _ = bowed_merge
    (rigid,), (bent,) = panels_of(merged), panels_of(merged, [deformed])
    assert "bent by" in bent.title
    assert "bent by" not in rigid.title
    # Of the walls that stand beside each other rigidly, none is left where the other map is free.
    assert len(contradicting(rigid.layers, RESOLUTION)) > 200
    assert len(contradicting(bent.layers, RESOLUTION)) < 20
    walls = {len(np.argwhere(one.layers[0].levels == OCCUPIED)) for one in (rigid, bent)}
    assert walls == {int((hall() == OCCUPIED).sum())}


def test_points_of_a_bent_map_move_with_it(bowed_merge):
    merged, deformed, back = bowed_merge
    places = np.argwhere(merged.levels["bowed"] == OCCUPIED)[:, ::-1] * RESOLUTION
    bowed_places = back.apply(places)
    straight = bowed_places - sagging(bowed_places, SAG, hall().shape[1] * RESOLUTION)
    assert np.quantile(np.hypot(*(deformed.places(1, places) - straight).T), 0.95) < 0.1
    assert np.allclose(deformed.places(0, places), places)
    assert deformed.deformations[1].agreement.contradicting_m < 1.0


def test_where_no_map_is_bent_the_rigid_overlay_is_drawn():
    levels = hall()
    maps = {"one": (levels, RESOLUTION), "two": (np.rot90(levels).copy(), RESOLUTION)}
    merged = merge_maps(maps)
    (group,) = merged.groups()
    deformed = merged.deformed(group)
    (rigid,), (bent,) = panels_of(merged), panels_of(merged, [deformed])
    assert deformed.deformations == [None, None]
    assert rigid.title == bent.title


def test_the_picture_of_bent_maps_shows_what_contradicts_then(bowed_merge, tmp_path):
    merged, deformed, _ = bowed_merge
    corners = dict.fromkeys(merged.levels, Transform())
    save_merge_picture(tmp_path / "rigid.png", merged, corners)
    save_merge_picture(tmp_path / "bent.png", merged, corners, [deformed])

    def red(name):
        """Return how many pixels above the legend have the colour of what contradicts."""
        picture = read_image(tmp_path / name).astype(int)
        drawn = picture[: int(0.9 * len(picture))]
        return int((np.abs(drawn[..., :3] - (38, 38, 220)).max(axis=-1) < 10).sum())

    assert red("rigid.png") > 100
    assert red("bent.png") < 10
