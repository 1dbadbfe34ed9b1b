"""Holes, stairs and pallets of the study are where geometry says."""

import numpy as np
import pytest

from lidarium.benchmarks.studies.sparse import places
from lidarium.benchmarks.studies.sparse.drops import (
    KINDS,
    PALLET_M,
    STAIR_M,
    STAIRS,
    TREAD_M,
    _on_stairs,
    areas_of,
    frames_with_areas,
    with_areas,
)
from lidarium.benchmarks.studies.sparse.places import BODY, load_place, requests_of, stops_of


@pytest.fixture(scope="module")
def arena():
    place = load_place("home_arena")
    return place, areas_of(place)


def test_areas_are_apart_and_requests_keep_off_them(arena):
    place, areas = arena
    assert {areas.kinds.count(kind) for kind in KINDS} == {2}
    seen, true = with_areas(place, areas)
    for low, high in areas.boxes:
        middle = 0.5 * (low + high)
        assert true.gaps_at(middle[None])[0] == 0.0
        ends = requests_of(true).reshape(-1, 2)
        assert np.hypot(*np.maximum(np.maximum(low - ends, ends - high), 0.0).T).min() > BODY.radius
    # A camera sees pallets alone.
    holes = areas.of("hole", "stairwell").mean(axis=1)
    assert (seen.gaps_at(holes) > 0.0).any()
    assert (seen.gaps_at(areas.of("pallet").mean(axis=1)) == 0.0).all()


def test_rays_meet_the_first_tread_below_them():
    box = np.array([[0.0, 0.0], [1.0, 1.0]])
    eye = np.array([-2.0, 0.5, 1.0])
    points = np.column_stack([np.linspace(0.01, 0.99, 50), np.full(50, 0.5), np.zeros(50)])
    found = _on_stairs(points, eye, box)
    assert (found[:, 2] < 0.0).all()
    for place, met in zip(points, found, strict=True):
        inside = 0.0 < met[0] < 1.0 - 1e-9
        if inside and met[2] > -STAIRS * STAIR_M + 1e-9:
            # On the ray, on a tread.
            np.testing.assert_allclose(np.cross(met - eye, place - eye), 0.0, atol=1e-9)
            assert np.ceil(-met[2] / STAIR_M - 1e-9) >= np.floor(met[0] / TREAD_M) + 1


def test_frames_have_no_floor_in_holes_and_pallets_on_it(arena, monkeypatch):
    place, areas = arena
    seen, _ = with_areas(place, areas)
    few = stops_of(seen)[:40:5]
    monkeypatch.setattr(places, "stops_of", lambda place: few)
    cloud = np.concatenate([frame.in_map[::2] for frame in frames_with_areas(seen, areas)])

    def heights(kind):
        low, high = areas.of(kind)[:, 0], areas.of(kind)[:, 1]
        inside = (cloud[:, None, :2] > low + 0.02) & (cloud[:, None, :2] < high - 0.02)
        return cloud[inside.all(axis=2).any(axis=1), 2]

    assert not (np.abs(heights("hole")) < 0.02).any()
    assert not (np.abs(heights("stairwell")) < 0.02).any()
    assert (heights("stairwell") < -0.02).any()
    pallets = heights("pallet")
    assert len(pallets) > 20
    assert (np.abs(pallets - PALLET_M) < 0.01).mean() > 0.5
