"""Maps of a group that are bent to agree."""

import numpy as np
import pytest
from drawn_maps import RESOLUTION, about_middle, blank, bowed, hall, kept, moved, room, sagging
from scipy.ndimage import distance_transform_edt

from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.grids.occupancy import OCCUPIED, UNKNOWN
from lidarium.mapping.merging.bend.deforming import deform
from lidarium.mapping.merging.bend.estimation import BendSettings
from lidarium.mapping.merging.described_map import describe_map
from lidarium.mapping.merging.fusion import fuse
from lidarium.mapping.merging.merger import merge_maps

SAG = 0.35


def gaps(fused, truth):
    """Return how far each wall cell of a fused map lies from a wall of a map in the same frame [m]."""
    away = distance_transform_edt(truth != OCCUPIED) * RESOLUTION
    rows, columns = np.nonzero(fused.levels == OCCUPIED)
    rows = rows + round(fused.origin[1] / RESOLUTION)
    columns = columns + round(fused.origin[0] / RESOLUTION)
    inside = (rows >= 0) & (columns >= 0) & (rows < truth.shape[0]) & (columns < truth.shape[1])
    assert inside.mean() > 0.99
    return away[rows[inside], columns[inside]]


@pytest.fixture(scope="module")
def bowed_group():
    """A hall, its bowed copy in a frame of its own, and where that lies."""
    levels = hall()
    there = about_middle(0.8, levels, (480, 480))
    copied = moved(bowed(levels, SAG), there, (480, 480))
    return levels, copied, there.inverse()


def test_a_bowed_copy_comes_back_to_its_original(bowed_group):
    levels, copied, back = bowed_group
    maps = [describe_map(one, RESOLUTION) for one in (levels, copied)]
    deformed = deform(maps, [Transform(), back], BendSettings())
    first, second = deformed.deformations
    assert first is None
    places = maps[1].walls
    bowed_places = back.apply(places)
    straight = bowed_places - sagging(bowed_places, SAG, levels.shape[1] * RESOLUTION)
    # A bend is in the cells of the fused map, which begins where something is known.
    corner = np.array(fuse([levels], [Transform()], RESOLUTION).origin)
    found = second.bend.field.bent(second.bend.a_from_b, places) + corner
    errors = np.hypot(*(found - straight).T)
    assert np.quantile(errors, 0.95) < 0.1
    assert np.quantile(gaps(deformed.fused, levels), 0.99) < 0.1
    assert second.most_m == pytest.approx(SAG, abs=0.1)
    assert 0.0 < second.mean_m < second.most_m <= BendSettings().reach_m


def test_each_map_is_bent_onto_all_before_it(bowed_group):
    levels, copied, back = bowed_group
    west = kept(levels, slice(0, 180), slice(0, 210))
    east = kept(levels, slice(0, 180), slice(180, 400))
    deformed = deform(
        [describe_map(one, RESOLUTION) for one in (west, east, copied)],
        [Transform(), Transform(), back],
        BendSettings(),
    )
    assert deformed.deformations[2] is not None
    assert np.quantile(gaps(deformed.fused, levels), 0.99) < 0.1


def test_what_would_have_to_be_bent_beyond_the_reach_is_laid_rigidly(bowed_group):
    levels, copied, back = bowed_group
    maps = [describe_map(one, RESOLUTION) for one in (levels, copied)]
    deformed = deform(maps, [Transform(), back], BendSettings(reach_m=0.2, last_reach_m=0.1))
    assert deformed.deformations[1] is None or deformed.deformations[1].most_m <= 0.2


def test_maps_without_walls_in_common_are_laid_as_they_were_joined():
    one, other = room(blank(), 20, 20, 60, 70), room(blank(), 20, 20, 50, 90)
    maps = [describe_map(levels, RESOLUTION) for levels in (one, other)]
    deformed = deform(maps, [Transform(), Transform(15.0, 0.0, 0.0)], BendSettings())
    assert deformed.deformations == [None, None]
    assert (deformed.fused.levels != UNKNOWN).sum() == (one != UNKNOWN).sum() + (other != UNKNOWN).sum()


def test_a_merged_group_can_be_deformed(bowed_group):
    levels, copied, _ = bowed_group
    merged = merge_maps({"straight": (levels, RESOLUTION), "bowed": (copied, RESOLUTION)})
    (group,) = merged.groups()
    assert len(group) == 2
    rigid, bent = merged.fused(group), merged.deformed(group).fused
    truth = levels if group[0] == "straight" else copied
    assert np.quantile(gaps(bent, truth), 0.99) < np.quantile(gaps(rigid, truth), 0.99)
    assert np.quantile(gaps(bent, truth), 0.99) < 0.1
