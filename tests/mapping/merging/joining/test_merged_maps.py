"""Maps that were merged are fused in the frame of the first of a group."""

import numpy as np
import pytest
from drawn_maps import RESOLUTION, apartment, bowed, kept

from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.grids.occupancy import UNKNOWN
from lidarium.mapping.merging.frame_tree import Edge, FrameTree
from lidarium.mapping.merging.joining.merged_maps import Merged, placed


def merged_of(levels, origins=None):
    """West and east joined where they belong, and a map that joins none."""
    tree = FrameTree()
    for name in levels:
        tree.add_map(name)
    frames = {name: placed((origins or {}).get(name, (0.0, 0.0))) for name in levels}
    tree.set_edges([Edge("west", "east", frames["west"] @ frames["east"].inverse(), 9.0)])
    return Merged(levels, RESOLUTION, {}, tree, origins or {})


def halves():
    whole = apartment()
    return {
        "west": kept(whole, slice(0, 180), slice(0, 120)),
        "east": kept(whole, slice(0, 180), slice(100, 220)),
        "alone": whole,
    }


@pytest.mark.parametrize("origins", [None, {"west": (-2.0, 1.0), "east": (3.5, 0.5)}])
def test_two_halves_are_fused_into_the_whole(origins):
    merged = merged_of(halves(), origins)
    assert merged.groups() == [["west", "east"], ["alone"]]
    fused = merged.fused(["west", "east"])
    x, y = (origins or {"west": (0.0, 0.0)})["west"]
    rows, columns = np.nonzero(apartment() != UNKNOWN)
    there = (
        rows + round((y - fused.origin[1]) / RESOLUTION),
        columns + round((x - fused.origin[0]) / RESOLUTION),
    )
    np.testing.assert_array_equal(fused.levels[there], apartment()[rows, columns])
    in_west, in_east = columns < 120, columns >= 100
    np.testing.assert_array_equal(fused.sources[there], in_west * np.uint64(1) + in_east * np.uint64(2))


def test_maps_that_are_not_joined_cannot_be_fused_or_deformed():
    merged = merged_of(halves())
    for attempt in (merged.fused, merged.deformed):
        with pytest.raises(ValueError, match="map 'alone' is not joined with 'west'"):
            attempt(["west", "alone"])


def test_a_group_is_deformed_onto_its_first_map():
    levels = halves() | {"west": apartment(), "east": bowed(apartment(), 0.25)}
    merged = merged_of(levels)
    deformed = merged.deformed(["west", "east"])
    rigid = merged.fused(["west", "east"])
    walls = apartment() == 0
    counts = [
        int(np.count_nonzero(one.levels == 0)) - int(np.count_nonzero(walls))
        for one in (deformed.fused, rigid)
    ]
    assert counts[0] < 0.5 * counts[1]


def test_a_corner_is_placed_in_its_frame_without_rotation():
    assert placed((1.5, -2.0)) == Transform(1.5, -2.0, 0.0)
