"""Wall lines of vector maps as floors."""

import pytest
from imported_floors import connectivity, free_of

from lidarium.envs.floors.importers import load_file


def test_a_vector_map_is_closed_where_its_outer_wall_has_a_gap(tmp_path):
    lines = ["0,0,6,0", "6,0,6,3", "6,3,0,3", "0,3,0,0.8", "3,0,3,1"]
    (tmp_path / "hall.vectormap.txt").write_text("\n".join(lines) + "\n")
    floor = load_file(tmp_path / "hall.vectormap.txt")
    assert floor.name == "hall"
    free = free_of(floor, 0.025)
    assert connectivity(free) == 1.0
    assert free.sum() * 0.025**2 == pytest.approx(5.9 * 2.9 - 0.1, rel=0.03)
    (tmp_path / "hall.txt").write_text("\n".join(lines))
    assert load_file(tmp_path / "hall.txt").sha256 == floor.sha256


@pytest.mark.parametrize(("name", "area"), [("GDC3", 3016.0), ("ASE1", 860.0)])
def test_a_building_of_wall_lines_is_free_inside_only(shared_data, name, area):
    floor = load_file(shared_data / "floorplans" / "amrl" / f"{name}.vectormap.txt.gz")
    assert free_of(floor).sum() * 0.05**2 == pytest.approx(area, rel=0.06)
