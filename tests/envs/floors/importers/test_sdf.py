import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from lidarium.envs.floors.importers import load_file, takes_resolution


def box(name, x, y, wide, deep, high=2.5, z=None, turns="0 0 0"):
    middle = high / 2 if z is None else z
    return (
        f'<link name="{name}"><pose>{x} {y} 0 0 0 0</pose><collision name="{name}_collision">'
        f"<pose>0 0 {middle} {turns}</pose>"
        f"<geometry><box><size>{wide} {deep} {high}</size></box></geometry></collision></link>"
    )


WALLS = (
    box("south", 3.0, 0.05, 6.0, 0.1)
    + box("north", 3.0, 3.95, 6.0, 0.1)
    + box("west", 0.05, 2.0, 0.1, 4.0)
    + box("east", 5.95, 2.0, 0.1, 4.0)
)


def world(tmp_path, inside, name="hall.world"):
    (tmp_path / name).write_text(
        f'<?xml version="1.0"?><sdf version="1.6"><world name="default">{inside}</world></sdf>'
    )
    return tmp_path / name


def model(inside, pose="0 0 0 0 0 0", name="walls"):
    return f'<model name="{name}"><static>1</static><pose>{pose}</pose>{inside}</model>'


def shape(geometry, pose="0 0 0 0 0 0"):
    inside = f'<collision name="thing"><pose>{pose}</pose><geometry>{geometry}</geometry></collision>'
    return model(f'<link name="a">{inside}</link>', name="thing")


def free_area(floor, z_low=0.3, z_high=0.3):
    return float((floor.raster(0.025, z_low, z_high).solid == 0).sum()) * 0.025**2


def solid_of(tmp_path, geometry, pose="0 0 0 0 0 0"):
    """Return the solid of a shape in the world; the last one, behind the surroundings."""
    return load_file(world(tmp_path, shape(geometry, pose))).solids[-1]


def test_walls_are_solid_and_what_is_around_them(tmp_path):
    floor = load_file(world(tmp_path, model(WALLS)))
    assert floor.name == "hall"
    assert floor.bounds == pytest.approx((0.0, 0.0, 6.0, 4.0))
    assert free_area(floor) == pytest.approx(5.8 * 3.8, rel=0.01)
    assert not takes_resolution(tmp_path / "hall.world")
    # The walls are 2.5 m high: above there is nothing but what is around the building.
    assert free_area(floor, 2.6, 2.6) > free_area(floor)


def test_what_is_high_or_low_is_so(tmp_path):
    table = box("table", 3.0, 2.0, 1.0, 1.0, high=0.1, z=0.75)
    floor = load_file(world(tmp_path, model(WALLS + table)))
    empty = load_file(world(tmp_path, model(WALLS)))
    assert free_area(floor, 0.3, 0.3) == pytest.approx(free_area(empty))
    assert free_area(floor, 0.0, 1.0) == pytest.approx(free_area(empty) - 1.0, rel=0.01)


def test_poses_of_models_links_and_collisions_add_up(tmp_path):
    link = (
        '<link name="l"><pose>1 0 0 0 0 1.5707963</pose><collision name="c"><pose>1 0 0.5 0 0 0</pose>'
        "<geometry><box><size>2 1 1</size></box></geometry></collision></link>"
    )
    floor = load_file(world(tmp_path, model(link, "10 20 0 0 0 3.1415927")))
    (ring,) = [solid.polygon for solid in floor.solids[-1:]]
    assert ring.min(axis=0) == pytest.approx([8.5, 18.0], abs=1e-3)
    assert ring.max(axis=0) == pytest.approx([9.5, 20.0], abs=1e-3)


def test_a_box_that_is_tilted_has_the_outline_of_its_corners(tmp_path):
    roll, pitch, yaw = 0.3, -0.5, 1.1
    solid = solid_of(tmp_path, "<box><size>2 1 0.6</size></box>", f"0 0 2 {roll} {pitch} {yaw}")
    corners = np.stack(np.meshgrid([-1.0, 1.0], [-0.5, 0.5], [-0.3, 0.3]), axis=-1).reshape(-1, 3)
    placed = Rotation.from_euler("xyz", [roll, pitch, yaw]).apply(corners) + np.array([0.0, 0.0, 2.0])
    assert (solid.z_low, solid.z_high) == pytest.approx((placed[:, 2].min(), placed[:, 2].max()))
    assert solid.polygon.min(axis=0) == pytest.approx(placed[:, :2].min(axis=0), abs=1e-5)
    assert solid.polygon.max(axis=0) == pytest.approx(placed[:, :2].max(axis=0), abs=1e-5)


@pytest.mark.parametrize(
    ("geometry", "area", "heights"),
    [
        ("<cylinder><radius>0.5</radius><length>2</length></cylinder>", math.pi / 4, (0.0, 2.0)),
        ("<sphere><radius>0.5</radius></sphere>", math.pi / 4, (0.5, 1.5)),
        ("<ellipsoid><radii>1 0.5 0.25</radii></ellipsoid>", math.pi / 2, (0.75, 1.25)),
        ("<capsule><radius>0.5</radius><length>1</length></capsule>", math.pi / 4, (0.0, 2.0)),
        (
            "<polyline><point>0 0</point><point>2 0</point><point>2 1</point><point>1 1</point>"
            "<point>1 2</point><point>0 2</point><height>1.5</height></polyline>",
            3.0,
            (1.0, 2.5),
        ),
    ],
)
def test_shapes_have_their_outline_and_height(tmp_path, geometry, area, heights):
    solid = solid_of(tmp_path, geometry, "0 0 1 0 0 0")
    x, y = solid.polygon.T
    found = abs(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1))) / 2
    assert found == pytest.approx(area, rel=0.01)
    assert (solid.z_low, solid.z_high) == pytest.approx(heights)


def test_included_models_are_found_beside_the_world(tmp_path):
    for place in (tmp_path / "worlds" / "chair", tmp_path / "models" / "chair"):
        place.mkdir(parents=True)
        (place / "model.sdf").write_text(f'<sdf version="1.6">{model(box("seat", 0, 0, 0.5, 0.5, 0.5))}</sdf>')
        include = "<include><uri>model://chair</uri><pose>3 2 0 0 0 0</pose></include>"
        floor = load_file(world(tmp_path / "worlds", model(WALLS) + include))
        assert free_area(floor) == pytest.approx(5.8 * 3.8 - 0.25, rel=0.01)
        (place / "model.sdf").unlink()
    with pytest.raises(ValueError, match=r"includes 'chair', which is not there; want its folder beside the world"):
        load_file(tmp_path / "worlds" / "hall.world")


def test_light_and_ground_of_gazebo_are_no_obstacles(tmp_path):
    library = "<include><uri>model://sun</uri></include><include><uri>model://ground_plane</uri></include>"
    plane = shape("<plane><normal>0 0 1</normal><size>100 100</size></plane>")
    slab = shape("<box><size>100 100 0.02</size></box>")
    floor = load_file(world(tmp_path, library + plane + slab + model(WALLS)))
    assert floor.bounds == pytest.approx((0.0, 0.0, 6.0, 4.0))


def test_a_saved_world_has_its_models_where_they_were_then(tmp_path):
    state = '<state world_name="default"><model name="crate"><pose>3 2 0 0 0 0</pose></model></state>'
    crate = model(box("crate", 0, 0, 1, 1), "50 50 0 0 0 0", "crate")
    floor = load_file(world(tmp_path, model(WALLS) + crate + state))
    assert floor.bounds == pytest.approx((0.0, 0.0, 6.0, 4.0))
    assert free_area(floor) == pytest.approx(5.8 * 3.8 - 1.0, rel=0.01)


@pytest.mark.parametrize(
    ("inside", "message"),
    [
        (
            shape("<mesh><uri>model://a/b.dae</uri></mesh>"),
            r"thing collides as mesh 'model://a/b.dae'; want one of box",
        ),
        (shape("<heightmap/>"), r"thing collides as heightmap"),
        (shape("<box><size>1 2</size></box>"), r"the size of a box '1 2'; want 3 numbers"),
        (shape("<box><size>1 2 nan</size></box>"), r"want 3 numbers"),
        (model(WALLS, "0 0 0"), r"the pose '0 0 0'; want 6 numbers"),
        ('<model name="a"><pose relative_to="b">0 0 0 0 0 0</pose></model>', r"a pose relative to 'b'"),
        ("<include><uri>../../etc</uri></include>", r"which is not there"),
        ("", r"no collision above the ground"),
        ("<model>", r"is not XML"),
        (shape("<polyline><point>0 0</point></polyline>"), r"polyline of 1 points; want at least 3"),
    ],
)
def test_what_cannot_be_read_is_refused_by_name(tmp_path, inside, message):
    with pytest.raises(ValueError, match=message):
        load_file(world(tmp_path, inside))


def test_a_model_that_includes_itself_is_refused(tmp_path):
    (tmp_path / "loop").mkdir()
    (tmp_path / "loop" / "model.sdf").write_text(
        '<sdf version="1.6"><model name="a"><include><uri>model://loop</uri></include></model></sdf>'
    )
    with pytest.raises(ValueError, match=r"nested more than 16 deep"):
        load_file(world(tmp_path, "<include><uri>model://loop</uri></include>"))


def test_another_document_is_refused(tmp_path):
    (tmp_path / "robot.sdf").write_text("<robot/>")
    with pytest.raises(ValueError, match=r"begins with 'robot'; want an sdf element"):
        load_file(tmp_path / "robot.sdf")
    with pytest.raises(ValueError, match=r"has its own scale"):
        load_file(world(tmp_path, model(WALLS)), 0.1)
