import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from lidarium.envs.floors.catalogue.names import describe_floor
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


def test_the_pose_of_an_include_takes_the_place_of_the_models_own(tmp_path):
    (tmp_path / "post").mkdir()
    own = model(box("post", 0, 0, 0.5, 0.5, 1.0), "2 1 0.5 0 0 0", "post")
    (tmp_path / "post" / "model.sdf").write_text(f'<sdf version="1.6">{own}</sdf>')
    for pose, middle in (("<pose>4 3 0 0 0 0</pose>", (4.0, 3.0, 0.0)), ("", (2.0, 1.0, 0.5))):
        include = f"<include><uri>model://post</uri>{pose}</include>"
        solid = load_file(world(tmp_path, model(WALLS) + include)).solids[-1]
        assert (*solid.polygon.mean(axis=0), solid.z_low) == pytest.approx(middle)


@pytest.mark.parametrize(
    "pose",
    [
        '<pose relative_to="__model__">1 0 0 0 0 0</pose>',
        '<pose relative_to="other">0 -1 0 0 0 -1.5707963</pose>',
        '<pose relative_to="turned">1 0 0 0 0 0</pose>',
        '<pose relative_to="inner::core">0 0 0 0 0 0</pose>',
        '<pose rotation_format="quat_xyzw">1 0 0 0 0 0 1</pose>',
    ],
)
def test_poses_are_relative_to_the_frames_that_they_name(tmp_path, pose):
    core = '<model name="inner"><pose>0.5 0 0 0 0 0</pose><link name="core"><pose>0.5 0 0 0 0 0</pose></link></model>'
    frames = (
        '<link name="other"><pose>2 0 0 0 0 1.5707963</pose></link>'
        '<frame name="turned" attached_to="other"><pose>0 2 0 0 0 -1.5707963</pose></frame>'
    )
    post = (
        f'<link name="post">{pose}<collision name="c"><geometry><box><size>1 0.5 1</size></box></geometry>'
        "</collision></link>"
    )
    floor = load_file(world(tmp_path, model(WALLS) + model(frames + core + post, "2 2 0.5 0 0 0", "thing")))
    x, y = (5.0, 2.0) if "other" in pose else (3.0, 2.0)
    assert floor.solids[-1].polygon.mean(axis=0) == pytest.approx((x, y), abs=1e-5)


def test_what_gazebos_reader_takes_is_read(tmp_path):
    hall = model(WALLS)
    wanted = load_file(world(tmp_path, hall)).sha256
    document = f'<sdf version="1.6"><world name="default">{hall}</world></sdf>'
    for text in (
        f'\n<?xml version="1.0"?>{document}',
        f'<!-- hall --><?xml version="1.0"?>{document}',
        document.replace(hall, f"<!-- sim -r --verbose -->{hall}<gz:level>low</gz:level>"),
    ):
        (tmp_path / "hall.world").write_text(text)
        assert load_file(tmp_path / "hall.world").sha256 == wanted
    (tmp_path / "hall.world").write_text(f'<!DOCTYPE sdf [<!ENTITY a "b">]>{document}')
    with pytest.raises(ValueError, match="declares the entity 'a'"):
        load_file(tmp_path / "hall.world")


def test_low_walls_are_no_furniture(tmp_path):
    low = WALLS.replace(" 2.5</size>", " 1.0</size>").replace("<pose>0 0 1.25", "<pose>0 0 0.5")
    middle = box("middle", 3.0, 1.4, 0.1, 2.6, high=1.0)
    furniture = box("shelf", 5.0, 3.5, 1.0, 0.5, high=1.6) + box("table", 1.0, 3.5, 1.0, 0.5, high=0.7)
    described = describe_floor(load_file(world(tmp_path, model(low + middle + furniture))))
    assert (described["rooms"], described["loops"]) == (1, 0)
    assert described["clutter"] == pytest.approx(1.0 / (5.8 * 3.8 - 0.26), rel=0.1)


def test_ground_and_ceiling_are_no_obstacles(tmp_path):
    empty = free_area(load_file(world(tmp_path, model(WALLS))), 0.0, 1.0)
    ground = box("ground", 3, 2, 20, 20, high=0.2, z=0.0)
    tiles = box("left", 1.5, 2, 3, 4, high=0.1, z=0.05) + box("right", 4.5, 2, 3, 4, high=0.1, z=0.05)
    roof = box("roof", 3, 2, 8, 8, high=0.2, z=2.6)
    for slabs in (ground, tiles, roof, ground + roof):
        floor = load_file(world(tmp_path, model(WALLS + slabs)))
        assert floor.bounds == pytest.approx((0.0, 0.0, 6.0, 4.0))
        assert free_area(floor, 0.0, 1.0) == pytest.approx(empty)
        assert floor.ceiling == pytest.approx(2.5 - 0.1 * (slabs == ground + roof))
    # A platform beside is an obstacle.
    floor = load_file(world(tmp_path, model(WALLS + box("platform", 3, 2, 2, 2, high=0.2, z=0.1))))
    assert free_area(floor, 0.0, 1.0) == pytest.approx(empty - 4.0, rel=0.01)


def test_meshes_stand_as_their_boxes_or_are_left_out(tmp_path):
    (tmp_path / "chair").mkdir()
    (tmp_path / "chair" / "seat.obj").write_text("v -1 -2 0\nv 1 2 0\nv 0 0 10\nf 1 2 3\n")
    facets = np.zeros(1, np.dtype([("numbers", "<f4", 12), ("other", "<u2")]))
    facets["numbers"][0, 3:] = [-1, -2, 0, 1, 2, 0, 0, 0, 10]
    (tmp_path / "chair" / "seat.stl").write_bytes(b" " * 80 + (1).to_bytes(4, "little") + facets.tobytes())
    for ending in ("obj", "stl"):
        mesh = f"<mesh><uri>model://chair/seat.{ending}</uri><scale>0.25 0.25 0.1</scale></mesh>"
        path = world(tmp_path, model(WALLS) + shape(mesh, "3 2 0 0 0 0"))
        floor = load_file(path)
        assert (floor.solids[-1].z_low, floor.solids[-1].z_high) == pytest.approx((0.0, 1.0))
        assert free_area(floor) == pytest.approx(5.8 * 3.8 - 0.5, rel=0.01)
        assert floor.remark == f"1 meshes stand as their bounding boxes: thing (model://chair/seat.{ending})"
        left_out = load_file(path, skip_meshes=True)
        assert left_out.sha256 == load_file(world(tmp_path, model(WALLS))).sha256
        assert "1 collisions are left out: thing" in left_out.remark
    building = shape("<mesh><uri>model://chair/seat.obj</uri><scale>3 1 1</scale></mesh>", "3 2 0 0 0 0")
    with pytest.raises(ValueError, match="fills the world"):
        load_file(world(tmp_path, model(WALLS) + building))
    with pytest.raises(ValueError, match="takes no layers; want skip_meshes"):
        load_file(path, layers=("a",))


@pytest.mark.parametrize(
    ("name", "area"),
    [
        ("sdf-include-pose/include.world", 76.08),
        ("sdf-frames-and-meshes/relative_to_world.world", 76.08),
        ("sdf-frames-and-meshes/relative_to_model.world", 76.08),
        ("sdf-frames-and-meshes/relative_to_another.world", 76.08),
        ("sdf-frames-and-meshes/cone.world", 76.16),
        ("gazebo-xml/plain.world", 76.44),
        ("gazebo-xml/blank_first.world", 76.44),
        ("gazebo-xml/hyphens.world", 76.44),
        ("gazebo-xml/late_declaration.world", 76.44),
        ("gazebo-xml/prefix.world", 76.44),
    ],
)
def test_worlds_of_other_programs_have_their_area(shared_cases, name, area):
    assert describe_floor(load_file(shared_cases / name))["area_m2"] == pytest.approx(area, abs=0.01)


def test_an_included_post_stands_where_the_include_says(shared_cases):
    raster = load_file(shared_cases / "sdf-include-pose" / "include.world").raster(0.05, 0.2, 0.2)
    rows, columns = np.floor((np.array([[-2.0, -1.0], [0.0, 0.0]]) - raster.origin)[:, ::-1] / 0.05).astype(int).T
    assert raster.solid[rows, columns].tolist() == [1, 0]


def test_all_meshes_that_cannot_be_read_are_named(shared_cases):
    path = shared_cases / "sdf-frames-and-meshes" / "two_meshes.world"
    with pytest.raises(ValueError, match=r"2 collisions .* seat .* foot .*--skip-meshes"):
        load_file(path)
    floor = load_file(path, skip_meshes=True)
    assert "2 collisions are left out" in floor.remark
    assert describe_floor(floor)["area_m2"] == pytest.approx(76.44)


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
            r"1 collisions that cannot be read: thing \(model://a/b.dae\); want box.*--skip-meshes leaves them out",
        ),
        (shape("<heightmap/>"), r"cannot be read: thing \(heightmap\)"),
        (shape("<box><size>1 2</size></box>"), r"the size of a box '1 2'; want 3 numbers"),
        (shape("<box><size>1 2 nan</size></box>"), r"want 3 numbers"),
        (model(WALLS, "0 0 0"), r"the pose '0 0 0'; want 6 numbers"),
        ('<model name="a"><pose relative_to="b">0 0 0 0 0 0</pose></model>', r"relative to 'b'; want a frame"),
        (
            '<model name="a"><pose relative_to="b"/></model><model name="b"><pose relative_to="a"/></model>',
            r"poses that are relative to each other",
        ),
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


def ring(*points):
    inside = "".join(f"<point>{x} {y}</point>" for x, y in points)
    return f"<polyline>{inside}<height>1</height></polyline>"


def test_polylines_within_others_are_their_holes_and_others_are_solids_of_their_own(tmp_path):
    outer, inner = ring((2, 1), (4, 1), (4, 3), (2, 3)), ring((2.5, 1.5), (3.5, 1.5), (3.5, 2.5), (2.5, 2.5))
    core, other = ring((2.9, 1.9), (3.1, 1.9), (3.1, 2.1), (2.9, 2.1)), ring((0.5, 0.5), (1, 0.5), (1, 1), (0.5, 1))
    floor = load_file(world(tmp_path, model(WALLS) + shape(outer + inner + core + other)))
    assert free_area(floor) == pytest.approx(5.8 * 3.8 - (4.0 - 1.0 + 0.04 + 0.25), rel=0.01)


def test_walls_of_a_height_are_walls_where_rooms_and_furniture_are_counted(tmp_path):
    wall = box("middle", 3.0, 1.3, 0.1, 2.4) + box("rest", 3.0, 3.5, 0.1, 0.9) + box("table", 1.0, 1.0, 1.0, 1.0, 0.75)
    found = describe_floor(load_file(world(tmp_path, model(WALLS + wall))))
    assert found["rooms"] == 2
    assert found["clutter"] == pytest.approx(1.0 / (5.8 * 3.8 - 0.33), rel=0.1)
