"""Boxes of a generated floor, and all of them turned."""

import math

import cv2
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from lidarium.envs.floors.floor import Floor
from lidarium.envs.floors.free_space import configuration_space, measure_building
from lidarium.envs.floors.generation.buildings import (
    KINDS,
    START_CLEARANCE,
    BuildingSettings,
    _draw_starts,
    _passable,
    _rotated,
    _solid_of,
    generate_building,
)
from lidarium.envs.floors.generation.furniture import Furnished


def test_rotation_turns_the_floor_and_keeps_its_figures():
    straight = generate_building(4, BuildingSettings(kind="apartment"))
    turned = generate_building(4, BuildingSettings(kind="apartment", rotation=0.5))
    before, after = measure_building(straight), measure_building(turned)
    assert (after.loops, after.rooms) == (before.loops, before.rooms)
    assert after.area_m2 == pytest.approx(before.area_m2, rel=0.03)
    assert np.allclose(turned.starts[:, 2] - straight.starts[:, 2], 0.5, atol=1e-3) or np.allclose(
        np.cos(turned.starts[:, 2] - straight.starts[:, 2]), math.cos(0.5), atol=1e-3
    )


def test_a_box_stands_on_its_rectangle():
    box = _solid_of((1.0, 2.0, 3.00004, 4.0), 1.5)
    assert box.polygon.tolist() == [[1.0, 2.0], [3.0, 2.0], [3.0, 4.0], [1.0, 4.0]]
    assert (box.z_low, box.z_high) == (0.0, 1.5)


def test_corners_that_open_are_filled_and_the_floor_lies_in_the_first_quadrant():
    straight = Floor(
        "hall", (0.0, 0.0, 4.0, 2.0), (_solid_of((0.0, 0.0, 4.0, 0.1)),), starts=np.array([[1.0, 1.0, 3.0]])
    )
    turned = _rotated(straight, 0.5)
    width, height = 4.0 * math.cos(0.5) + 2.0 * math.sin(0.5), 4.0 * math.sin(0.5) + 2.0 * math.cos(0.5)
    assert turned.bounds == pytest.approx((0.0, 0.0, width, height), abs=1e-3)
    assert len(turned.solids) == 1 + 4
    free = float((turned.raster(0.025, 0.2, 0.2).solid == 0).sum()) * 0.025**2
    assert free == pytest.approx(4.0 * 1.9, rel=0.02)
    assert turned.starts[0, 2] == pytest.approx(3.5 - 2.0 * math.pi, abs=1e-3)
    assert _rotated(straight, 0.0) is straight


def test_starts_are_half_a_metre_off_all_that_stands_and_far_from_each_other():
    for seed in range(12):
        floor = generate_building(seed)
        raster = floor.raster(0.025, 0.0, 2.0)
        solid = np.argwhere(raster.solid)[:, ::-1] * raster.resolution + raster.origin
        for start in floor.starts:
            nearest = np.maximum(np.maximum(solid - start[:2], start[:2] - solid - raster.resolution), 0.0)
            assert np.hypot(*nearest.T).min() >= START_CLEARANCE - 1e-6
        apart = min(math.dist(floor.starts[i, :2], floor.starts[j, :2]) for i, j in ((0, 1), (0, 2), (1, 2)))
        assert apart > 0.25 * math.dist(floor.bounds[:2], floor.bounds[2:])


BOUNDS = (0.0, 0.0, 8.0, 4.0)
LABELS = np.zeros((40, 80), np.int32)
LABELS[:, 40:] = 1


def piece(room, *rectangle):
    return Furnished(room, rectangle, (_solid_of(rectangle, 1.0),))


def walls(gap):
    half = (4.0 - gap) / 2
    return _solid_of((3.9, 0.0, 4.1, half)), _solid_of((3.9, 4.0 - half, 4.1, 4.0))


def test_what_stands_in_a_door_is_left_out_and_the_rest_stays():
    harmless, blocking = piece(0, 0.0, 0.0, 0.5, 0.5), piece(1, 4.2, 1.5, 4.6, 2.5)
    kept, clear, origin = _passable(BOUNDS, walls(1.0), [harmless, blocking], LABELS)
    assert kept == [harmless]
    starts = _draw_starts(clear, origin, np.random.default_rng(0))
    assert len(starts) == 3
    assert np.abs(starts[:, 0] - 4.0).max() > 2.0


def test_walls_without_a_door_cannot_be_mended():
    assert _passable(BOUNDS, walls(0.0), [], LABELS) is None
    assert _passable(BOUNDS, walls(0.5), [], LABELS) is None


def test_a_nook_behind_a_piece_is_not_left_cut_off():
    shelf = piece(1, 6.5, 0.0, 7.0, 4.0)
    kept, _, _ = _passable(BOUNDS, walls(1.0), [shelf], LABELS)
    assert kept == []


ROBOT_RADIUS = 0.30


def parts(floor: Floor, resolution: float, height: float, connectivity: int = 4) -> int:
    """Return the number of separate parts of the space in which the largest robot can move."""
    space = configuration_space(floor.raster(resolution, 0.0, height), ROBOT_RADIUS)
    return int(cv2.connectedComponents(space.astype(np.uint8), connectivity=connectivity)[0]) - 1


def mean_measures(**wanted):
    measured = [measure_building(generate_building(seed, BuildingSettings(**wanted))) for seed in range(6)]
    return {
        name: float(np.mean([getattr(m, name) for m in measured])) for name in ("area_m2", "loops", "clutter", "rooms")
    }


@pytest.mark.parametrize("height", [0.5, 2.0])
@pytest.mark.parametrize("resolution", [0.05, 0.025])
@pytest.mark.parametrize("kind", KINDS)
def test_a_robot_of_radius_30_cm_reaches_everything(kind, resolution, height):
    for seed in range(10):
        assert parts(generate_building(seed, BuildingSettings(kind=kind)), resolution, height) == 1, f"seed {seed}"


@settings(max_examples=25)
@given(
    seed=st.integers(0, 2**63),
    kind=st.sampled_from(KINDS),
    loops=st.floats(0.0, 1.0),
    clutter=st.floats(0.0, 0.3),
    door_width=st.floats(0.8, 1.0),
    wall_thickness=st.floats(0.05, 0.3),
)
@example(seed=1355424, kind="apartment", loops=0.0, clutter=0.0, door_width=0.9999999999999999, wall_thickness=0.25)
def test_whatever_the_settings_the_floor_is_one_piece_with_three_clear_starts(
    seed, kind, loops, clutter, door_width, wall_thickness
):
    wanted = BuildingSettings(
        kind=kind, loops=loops, clutter=clutter, door_width=door_width, wall_thickness=wall_thickness
    )
    floor = generate_building(seed, wanted)
    # Walls off the lattice leave single cells at the rim of the space, which touch it by a corner.
    assert parts(floor, 0.05, 2.0, connectivity=8) == 1
    assert floor.starts.shape == (3, 3)


def test_the_same_seed_gives_the_same_floor_and_another_seed_another():
    for kind in (*KINDS, "any"):
        wanted = BuildingSettings(kind=kind, rotation=0.3)
        assert generate_building(5, wanted).sha256 == generate_building(5, wanted).sha256
        assert generate_building(5, wanted).sha256 != generate_building(6, wanted).sha256


@pytest.mark.parametrize(
    ("kind", "areas"),
    [("apartment", (40.0, 70.0, 120.0)), ("office", (150.0, 350.0, 600.0)), ("corridors", (80.0, 250.0))],
)
def test_the_area_asked_for_is_the_area_between_the_walls(kind, areas):
    for area in areas:
        for seed in range(4):
            measures = measure_building(generate_building(seed, BuildingSettings(kind=kind, area_m2=area)))
            assert measures.area_m2 / (1.0 - measures.clutter) == pytest.approx(area, rel=0.08)


@pytest.mark.parametrize("kind", KINDS)
def test_asking_for_more_loops_gives_more(kind):
    found = [mean_measures(kind=kind, area_m2=120.0, loops=share)["loops"] for share in (0.0, 0.4, 1.0)]
    assert found[0] + 0.5 < found[1] < found[2] - 0.5


@pytest.mark.parametrize("kind", KINDS)
def test_asking_for_more_clutter_gives_more(kind):
    found = [mean_measures(kind=kind, area_m2=120.0, clutter=share)["clutter"] for share in (0.0, 0.08, 0.16)]
    assert found[0] == 0.0
    assert found[1] == pytest.approx(0.08, abs=0.025)
    assert found[2] == pytest.approx(0.16, abs=0.035)


def test_an_apartment_without_extra_doors_has_no_loop():
    assert all(
        measure_building(generate_building(seed, BuildingSettings(kind="apartment", loops=0.0))).loops == 0
        for seed in range(8)
    )


def test_a_knob_of_one_stage_leaves_the_walls_alone():
    def walls(floor):
        return [solid.polygon.tolist() for solid in floor.solids if solid.z_high == math.inf]

    sparse, dense = (generate_building(3, BuildingSettings(kind="office", clutter=share)) for share in (0.0, 0.2))
    assert walls(sparse) == walls(dense)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("kind", "castle"),
        ("area_m2", 10.0),
        ("loops", 1.5),
        ("clutter", -0.1),
        ("door_width", 0.5),
        ("corridor_width", math.nan),
        ("room_size", (3.0, 3.5)),
        ("rotation", math.inf),
    ],
)
def test_settings_out_of_range_are_refused_by_name(name, value):
    with pytest.raises(ValueError, match=name):
        BuildingSettings(**{name: value})


def test_a_negative_seed_is_refused():
    with pytest.raises(ValueError, match="-1"):
        generate_building(-1)
