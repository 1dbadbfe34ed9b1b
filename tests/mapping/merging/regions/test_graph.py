"""Regions of a map: their shapes, and the doors between them."""

import math
from pathlib import Path

import numpy as np
import pytest
from drawn_maps import RESOLUTION, about_middle, blank, moved, noisy, room

from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.grids.occupancy import FREE, OCCUPIED, UNKNOWN
from lidarium.mapping.merging.description.resampling import resampled
from lidarium.mapping.merging.regions.graph import _joined, find_regions
from lidarium.mapping.merging.regions.settings import RegionSettings

SETTINGS = RegionSettings()


def suite():
    """Return two rooms beside each other above a corridor, with three doors.

    The rooms have 3 by 2.5 m and 4 by 2.5 m, the corridor 7.15 by 1.5 m.
    """
    levels = blank()
    room(levels, 20, 10, 30, 143)
    room(levels, 53, 10, 50, 60)
    room(levels, 53, 73, 50, 80)
    levels[50:53, 30:48] = FREE
    levels[50:53, 100:116] = FREE
    levels[70:86, 70:73] = FREE
    return levels


def test_rooms_have_their_shapes_and_doors_their_places():
    found = find_regions(suite(), RESOLUTION, SETTINGS)
    assert len(found) == 3
    by_area = np.argsort(found.areas)
    np.testing.assert_allclose(found.areas[by_area], (7.5, 10.0, 10.725), atol=0.3)
    for region, extents in zip(by_area, ((3.0, 2.5), (4.0, 2.5), (7.15, 1.5)), strict=True):
        off = (found.axes[region] + 0.5) % (math.pi / 2) - 0.5
        along = (
            found.extents[region]
            if abs(off) < 0.2 and found.axes[region] < 0.5
            else found.extents[region][::-1]
        )
        np.testing.assert_allclose(along, extents, atol=0.12)
        assert abs(off) < math.radians(2.0)
    west, east, corridor = by_area.tolist()
    np.testing.assert_allclose(found.centres[west], (2.0, 3.9), atol=0.1)
    assert found.adjacency == {
        west: sorted((east, corridor)),
        east: sorted((west, corridor)),
        corridor: sorted((west, east)),
    }
    assert found.door_counts.tolist() == [2, 2, 2]
    doors = {tuple(pair): k for k, pair in enumerate(found.doors.regions.tolist())}
    for pair, place, width, direction in (
        ((west, corridor), (1.95, 2.575), 0.9, 1.0),
        ((east, corridor), (5.4, 2.575), 0.8, 1.0),
        ((west, east), (3.575, 3.9), 0.8, 0.0),
    ):
        k = doors[tuple(sorted(pair))]
        np.testing.assert_allclose(found.doors.places[k], place, atol=0.12)
        assert found.doors.widths[k] == pytest.approx(width, abs=0.08)
        assert abs(math.sin(found.doors.normals[k])) == pytest.approx(direction, abs=0.1)


@pytest.mark.parametrize("theta", [0.4, 1.3, 2.9])
def test_regions_and_doors_move_with_the_map(theta):
    still = find_regions(suite(), RESOLUTION, SETTINGS)
    there = about_middle(theta, suite(), shift=(0.7, -0.4))
    found = find_regions(noisy(moved(suite(), there), 3, 0.05), RESOLUTION, SETTINGS)
    assert len(found) == len(still)
    nearest = [int(np.hypot(*(found.centres - place).T).argmin()) for place in there.apply(still.centres)]
    assert sorted(nearest) == list(range(len(still)))
    np.testing.assert_allclose(found.areas[nearest], still.areas, rtol=0.08)
    turn = (found.axes[nearest] - still.axes - theta + 0.5) % (math.pi / 2) - 0.5
    assert np.abs(turn).max() < math.radians(2.0)
    np.testing.assert_allclose(np.sort(found.doors.widths), np.sort(still.doors.widths), atol=0.15)
    for place in there.apply(still.doors.places):
        # A door may lie anywhere in the depth of its wall, and cells are turned.
        assert np.hypot(*(found.doors.places - place).T).min() < 0.2


def test_finer_cells_give_the_same_regions():
    fine = np.kron(suite(), np.ones((2, 2), np.uint8))
    coarse, found = (
        find_regions(levels, side, SETTINGS) for levels, side in ((suite(), 0.05), (fine, 0.025))
    )
    assert found.resolution == pytest.approx(0.05)
    np.testing.assert_allclose(found.areas, coarse.areas)
    np.testing.assert_allclose(found.doors.places, coarse.doors.places)


def test_large_maps_are_split_in_larger_cells():
    found = find_regions(suite(), RESOLUTION, RegionSettings(most_cells=8000))
    assert found.resolution == pytest.approx(0.1)
    assert len(found) == 3


@pytest.mark.parametrize("count", [1, 2, 3])
def test_joined_cells_are_those_of_resampled_maps(count):
    generator = np.random.default_rng(count)
    levels = generator.choice(np.array([UNKNOWN, FREE], np.uint8), (60, 48))
    levels[generator.random(levels.shape) < 0.05] = OCCUPIED
    np.testing.assert_array_equal(_joined(levels, count), resampled(levels, RESOLUTION, RESOLUTION * count))


@pytest.mark.parametrize("level", [FREE, OCCUPIED, UNKNOWN])
@pytest.mark.parametrize("shape", [(1, 1), (60, 90)])
def test_maps_of_one_level_have_no_doors(level, shape):
    found = find_regions(np.full(shape, level, np.uint8), RESOLUTION, SETTINGS)
    assert len(found) == (level == FREE and shape != (1, 1))
    assert len(found.doors.widths) == 0
    assert found.adjacency == {region: [] for region in range(len(found))}


def test_what_is_known_may_lie_anywhere_in_the_array():
    levels = np.full((400, 500), UNKNOWN, np.uint8)
    levels[150:310, 200:400] = suite()
    found, still = (find_regions(each, RESOLUTION, SETTINGS) for each in (levels, suite()))
    shift = Transform(200 * RESOLUTION, 150 * RESOLUTION, 0.0)
    np.testing.assert_allclose(found.doors.places, shift.apply(still.doors.places))
    np.testing.assert_allclose(found.centres, shift.apply(still.centres))


def test_the_code_of_the_reference_page_runs(capsys):
    text = (Path(__file__).parents[4] / "docs" / "reference" / "merging.md").read_text(encoding="utf-8")
    section = text[text.index("## Regions and doors") :]
    code = section[section.index("```python\n") + 10 :].partition("```")[0]
    exec(compile(code, "merging.md", "exec"), {"jade_levels": suite()})
    assert "{0: [" in capsys.readouterr().out


def test_settings_that_make_no_sense_are_named():
    with pytest.raises(ValueError, match="widest_door_m"):
        RegionSettings(widest_door_m=0.0)
    with pytest.raises(ValueError, match="door_share"):
        RegionSettings(door_share=1.5)
