"""Generated buildings are plausible, passable, repeatable, and what was asked for."""

import math

import cv2
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from lidarium.envs.floors.floor import Floor
from lidarium.envs.floors.free_space import configuration_space
from lidarium.envs.floors.generation.buildings import KINDS, BuildingSettings, generate_building
from lidarium.envs.floors.measures import measure_building

ROBOT_RADIUS = 0.30


def parts(floor: Floor, resolution: float, height: float, connectivity: int = 4) -> int:
    """Return the number of separate parts of the space in which the largest robot can move."""
    space = configuration_space(floor.raster(resolution, 0.0, height), ROBOT_RADIUS)
    return int(cv2.connectedComponents(space.astype(np.uint8), connectivity=connectivity)[0]) - 1


def mean_measures(**wanted):
    measured = [measure_building(generate_building(seed, BuildingSettings(**wanted))) for seed in range(6)]
    return {
        name: float(np.mean([getattr(m, name) for m in measured]))
        for name in ("area_m2", "loops", "clutter", "rooms")
    }


@pytest.mark.parametrize("height", [0.5, 2.0])
@pytest.mark.parametrize("resolution", [0.05, 0.025])
@pytest.mark.parametrize("kind", KINDS)
def test_a_robot_of_radius_30_cm_reaches_everything(kind, resolution, height):
    for seed in range(10):
        assert parts(generate_building(seed, BuildingSettings(kind=kind)), resolution, height) == 1, (
            f"seed {seed}"
        )


@settings(max_examples=25)
@given(
    seed=st.integers(0, 2**63),
    kind=st.sampled_from(KINDS),
    loops=st.floats(0.0, 1.0),
    clutter=st.floats(0.0, 0.3),
    door_width=st.floats(0.8, 1.0),
    wall_thickness=st.floats(0.05, 0.3),
)
@example(
    seed=1355424, kind="apartment", loops=0.0, clutter=0.0, door_width=0.9999999999999999, wall_thickness=0.25
)
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

    sparse, dense = (
        generate_building(3, BuildingSettings(kind="office", clutter=share)) for share in (0.0, 0.2)
    )
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
