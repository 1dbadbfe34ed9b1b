"""The picture of regions and doors."""

import numpy as np
import pytest
from drawn_maps import RESOLUTION, apartment, blank

from lidarium.evaluation.drawing.region_picture import RegionMap, door_ends, save_region_picture
from lidarium.mapping.files.images import read_image
from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.grids.occupancy import FREE, OCCUPIED
from lidarium.mapping.merging.regions.graph import find_regions
from lidarium.mapping.merging.regions.segmentation import RegionSettings


def graph(levels):
    return find_regions(levels, RESOLUTION, RegionSettings())


def test_bars_of_doors_reach_from_wall_to_wall():
    found = graph(apartment())
    ends = door_ends(found)
    assert ends.shape == (len(found.doors.widths), 2, 2)
    np.testing.assert_allclose(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1), found.doors.widths)
    walls = (np.argwhere(apartment() == OCCUPIED)[:, ::-1] + 0.5) * RESOLUTION
    narrow = ends[found.doors.widths < 1.2].reshape(-1, 2)
    gaps = np.linalg.norm(walls[None] - narrow[:, None], axis=-1).min(axis=1)
    assert np.median(gaps) < 0.1


def test_each_map_is_drawn_with_its_regions(tmp_path):
    maps = {
        name: RegionMap(levels, RESOLUTION, graph(levels), Transform(1.0, 2.0, 0.3))
        for name, levels in (
            ("flat", apartment()),
            ("bare", np.full((40, 60), FREE, np.uint8)),
            ("dark", blank()),
        )
    }
    save_region_picture(tmp_path / "regions.png", maps)
    picture = read_image(tmp_path / "regions.png").astype(int)
    assert picture.shape[1] == pytest.approx(3 * picture.shape[0], rel=0.05)
    is_door = np.abs(picture[..., :3] - (72, 29, 225)).max(axis=-1) < 10
    assert is_door[:, : picture.shape[1] // 3].sum() > 50
    assert is_door[:, picture.shape[1] // 3 :].sum() == 0
