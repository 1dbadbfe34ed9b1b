"""Annotated apartments as floors."""

import json

import pytest
from imported_floors import connectivity, free_of

from lidarium.envs.floors.importers import load_file

APARTMENT = [
    "0 0 600 0 wall",
    "600 0 600 300 wall",
    "600 300 0 300 wall",
    "0 300 0 0 wall",
    "300 0 300 300 wall",
    "300 100 300 180 door",
    "100 0 180 0 door",
    "400 300 480 300 door",
    "50 50 90 70 bedroom",
]


def test_doors_of_an_apartment_are_open_inside_and_its_outline_is_closed(tmp_path):
    (tmp_path / "flat.txt").write_text("\n".join(line.replace(" ", "\t") + "\t1\t1\t" for line in APARTMENT))
    floor = load_file(tmp_path / "flat.txt")
    free = free_of(floor, 0.025)
    assert connectivity(free) == 1.0
    # 6 m x 3 m with half a wall of 0.1 m inside, a wall between the rooms, and recesses at the doors to the
    # outside.
    assert free.sum() * 0.025**2 == pytest.approx(5.8 * 2.9 + 0.1 * 0.8, rel=0.02)
    assert floor.bounds == pytest.approx((-0.05, -0.05, 6.05, 3.05))


def test_apartments_are_connected_and_have_the_size_that_is_known(shared_data):
    folder = shared_data / "floorplans" / "lifull"
    about = json.loads((folder / "meta.json").read_text())
    for name in sorted(about)[::12]:
        floor = load_file(folder / "txt" / f"{name}.txt")
        assert connectivity(free_of(floor, 0.025)) > about[name]["conn"] - 0.03
        width, height = floor.bounds[2] - floor.bounds[0] - 0.1, floor.bounds[3] - floor.bounds[1] - 0.1
        assert (width, height) == pytest.approx((about[name]["width_m"], about[name]["height_m"]), rel=0.02)
