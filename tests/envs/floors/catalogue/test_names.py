"""Packed floors come back to the bit."""

import math

import cv2
import numpy as np
import pytest

from lidarium.envs.floors.catalogue.names import (
    HASHED_FLOORS,
    SETS,
    _hash_of_floors,
    _packed_floor,
    _set_sha256,
    _unpacked_floor,
    about_floor,
    describe_floor,
    floor_names,
    load_floor,
    set_floors,
)
from lidarium.envs.floors.floor import Floor, Raster, Solid
from lidarium.envs.floors.free_space import configuration_space, measure_building
from lidarium.envs.floors.generation.buildings import generate_building
from lidarium.envs.floors.starts import check_starts
from lidarium.envs.settings.robots import ROBOTS

SQUARE = np.array([(1.0, 1.0), (3.0, 1.0), (3.0, 3.0 + 1e-13), (1.0, 3.0)])


def with_holes_and_goal():
    solids = (Solid(SQUARE, 0.1, 2.0, (SQUARE / 4 + 1.2, SQUARE[:3] / 5 + 2.0)), Solid(SQUARE[:3] + 4.0))
    return Floor("größer", (0.0, -1.0, 8.0, 9.5), solids, starts=np.array([(0.5, 0.5, 0.1)]), goal=(7.0, 8.0))


@pytest.mark.parametrize(
    "make",
    [
        lambda: generate_building(3),
        lambda: load_floor("apartment"),
        with_holes_and_goal,
        lambda: Floor("empty", (0.0, 0.0, 1.0, 1.0)),
    ],
    ids=["generated", "apartment", "holes", "empty"],
)
def test_a_floor_comes_back_to_the_bit(make):
    floor = make()
    back = _unpacked_floor(_packed_floor(floor))
    assert (back.name, back.bounds, back.goal) == (floor.name, floor.bounds, floor.goal)
    assert np.array_equal(back.starts, floor.starts)
    assert len(back.solids) == len(floor.solids)
    for one, other in zip(back.solids, floor.solids, strict=True):
        assert (one.z_low, one.z_high) == (other.z_low, other.z_high)
        assert np.array_equal(one.polygon, other.polygon)
        assert len(one.holes) == len(other.holes)
        assert all(map(np.array_equal, one.holes, other.holes))
    assert back.sha256 == floor.sha256
    assert back.geometry_sha256 == floor.geometry_sha256


def test_a_floor_of_cells_is_refused():
    cells = Raster(np.ones((3, 3), np.uint8), (0.0, 0.0), 0.1)
    with pytest.raises(ValueError, match="made of cells"):
        _packed_floor(Floor("image", (0.0, 0.0, 0.3, 0.3), cells=cells))


SCENES = (
    "scene_loop",
    "scene_corridor",
    "scene_corner",
    "scene_room",
    "scene_loop_corridor",
    "scene_room_corner",
)

TREE_WORLDS = (
    "srt_corridor",
    "srt_l_room",
    "srt_lab",
    "srt_t_junction",
    "srt_cluttered",
    "srt_cluttered_reachable",
)
LABORATORIES = ("robotics_laboratory", "signal_laboratory")
TEAM_FLOORS = ("apartment", "clinic", "home_arena", "open_apartment", *LABORATORIES, *SCENES)


def test_the_catalogue_holds_six_furnished_floors_six_scenes_and_six_worlds_with_goals():
    assert set(floor_names()) == {*TEAM_FLOORS, *TREE_WORLDS}
    assert all(about_floor(name).endswith(".") for name in floor_names())


@pytest.mark.parametrize("name", TEAM_FLOORS)
def test_every_drawn_floor_for_teams_is_one_piece_for_the_largest_robot_with_three_starts(name):
    floor = load_floor(name)
    assert floor.name == name
    assert floor.starts.shape == (3, 3)
    assert floor.goal is None
    for resolution in (0.05, 0.025):
        for height in (0.5, 2.0):
            raster = floor.raster(resolution, 0.0, height)
            space = configuration_space(raster, 0.30)
            assert cv2.connectedComponents(space.astype(np.uint8), connectivity=4)[0] - 1 == 1
            for start in floor.starts:
                check_starts(raster, 0.5, start[None])


@pytest.mark.parametrize("name", TREE_WORLDS)
def test_the_way_to_the_goal_is_free_for_a_pioneer_unless_the_goal_is_enclosed(name):
    floor = load_floor(name)
    radius = ROBOTS["pioneer"].radius
    assert floor.starts.shape == (1, 3)
    assert floor.starts[0, :2].tolist() == [0.0, 0.0]
    assert all(math.isfinite(solid.z_high) for solid in floor.solids)
    raster = floor.raster(0.01, 0.0, 0.3)
    check_starts(raster, radius, floor.starts)
    labels = cv2.connectedComponents(configuration_space(raster, radius).astype(np.uint8), connectivity=4)[1]
    cells = ((np.array([floor.starts[0, :2], floor.goal]) - raster.origin) / raster.resolution).astype(int)
    at_start, at_goal = labels[cells[:, 1], cells[:, 0]]
    assert at_start != 0
    assert at_goal != 0
    assert (at_start == at_goal) == (name != "srt_cluttered")


def test_the_two_cluttered_worlds_differ_by_the_lid_over_the_goal():
    closed, opened = load_floor("srt_cluttered"), load_floor("srt_cluttered_reachable")
    more = closed.raster(0.01, 0.3, 0.3).solid - opened.raster(0.01, 0.3, 0.3).solid
    assert set(np.unique(more)) == {0, 1}
    assert int(more.sum()) == 120 * 15


def test_the_indoor_floors_are_as_large_as_they_say():
    assert measure_building(load_floor("apartment")).area_m2 == pytest.approx(65.0, abs=2.0)
    assert measure_building(load_floor("clinic")).area_m2 > 65.0
    assert all(load_floor(name).bounds == (0.0, 0.0, 25.0, 25.0) for name in SCENES)


def test_what_the_scenes_promise_is_measured():
    loops = {name: measure_building(load_floor(name)).loops for name in SCENES}
    assert loops["scene_loop"] == 1
    assert loops["scene_loop_corridor"] >= 3
    assert all(count >= 3 for name, count in loops.items() if name != "scene_loop")


def test_generated_floors_are_found_by_kind_and_seed():
    for kind in ("apartment", "office", "corridors"):
        assert load_floor(f"{kind}:7").name == f"{kind}:7"
    assert load_floor("building:7").name.endswith(":7")
    assert load_floor("building:7") is load_floor("building:7")
    assert load_floor("building:7").sha256 != load_floor("building:8").sha256


def test_a_floor_is_returned_as_it_is():
    floor = load_floor("scene_loop")
    assert load_floor(floor) is floor


def test_an_unknown_name_is_answered_with_the_nearest_one_and_the_list():
    with pytest.raises(ValueError, match="did you mean 'apartment'") as caught:
        load_floor("apartmant")
    assert all(name in str(caught.value) for name in floor_names())
    with pytest.raises(ValueError, match="no floor called"):
        load_floor("")


@pytest.mark.parametrize("seed", ["", "x", "-1", "1.5"])
def test_a_seed_that_is_no_number_is_refused(seed):
    with pytest.raises(ValueError, match="want a whole number"):
        load_floor(f"building:{seed}")


def test_a_set_is_refused_where_one_floor_is_wanted():
    with pytest.raises(ValueError, match="set_floors"):
        load_floor("set:train")


def test_a_resolution_belongs_to_files_only():
    with pytest.raises(ValueError, match="resolution"):
        load_floor("apartment", resolution=0.05)


def test_paths_go_to_the_importers(tmp_path):
    with pytest.raises(FileNotFoundError):
        load_floor(str(tmp_path / "nothing.png"))
    with pytest.raises(FileNotFoundError):
        load_floor("nothing.yaml")


def test_an_image_of_the_dungeons_is_loaded_by_its_path(shared_data):
    image = next(iter(sorted(shared_data.rglob("*dungeon*/**/*.png"))), None)
    if image is None:
        pytest.skip("no dungeon image in the real data")
    assert load_floor(image).cells is not None


def test_sets_are_disjoint_and_of_the_promised_sizes():
    specs = {name: set_floors(name) for name in SETS}
    assert {name: len(floors) for name, floors in specs.items()} == {
        "train": 10_000,
        "validation": 200,
        "test": 200,
    }
    assert len(set().union(*specs.values())) == 10_400
    assert set_floors("set:test") == specs["test"]


@pytest.mark.parametrize("name", SETS)
def test_the_floors_of_a_set_are_those_whose_hash_is_kept(name):
    assert _hash_of_floors(set_floors(name)[:HASHED_FLOORS]) == _set_sha256(name)


def test_an_unknown_set_is_answered_with_the_nearest_one():
    with pytest.raises(ValueError, match="did you mean 'validation'"):
        set_floors("validate")


def test_a_description_holds_the_figures_of_a_floor():
    described = describe_floor(load_floor("apartment"))
    assert described["size_m"] == [11.8, 8.4]
    assert described["rooms"] == 7
    assert described["loops"] == 2
    assert described["sha256"] == load_floor("apartment").sha256


@pytest.mark.parametrize("name", ["apar" + "(" * 5000, "a/" + "(" * 5000, "(" * 5000 + ".png"])
def test_a_name_too_long_for_a_file_is_told_in_a_line(name):
    with pytest.raises((ValueError, FileNotFoundError), match=r"no floor called|no file") as caught:
        load_floor(name)
    assert len(str(caught.value)) <= 500
