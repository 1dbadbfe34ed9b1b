import gzip
import json
import math

import cv2
import numpy as np
import pytest
import yaml
from scipy import ndimage

from lidarium.envs.floors.importers import load_file

# Small floors of the real sets whose pictures are connected (meta.json: conn).
KTH = [
    "A0043001__0510034691_Layout1",
    "A0043002__50057024",
    "A0050018__0510034880_A-40",
    "A0043018__0510040941_A-40.1-805",
]
SLAM_MAPS = ["radish_intel", "willow_garage_2010", "linorobot_house", "intel_lab_bwi"]


def free_of(floor, resolution=0.05):
    return floor.raster(resolution, 0.2, 0.2).solid == 0


def connectivity(free):
    areas = np.bincount(ndimage.label(free)[0].ravel())[1:]
    return areas.max() / areas.sum()


def write_map(folder, levels, **changes):
    cv2.imwrite(str(folder / "map.png"), np.asarray(levels, np.uint8))
    header = {
        "image": "map.png",
        "resolution": 0.1,
        "origin": [0.0, 0.0, 0.0],
        "negate": 0,
        "occupied_thresh": 0.65,
        "free_thresh": 0.196,
    }
    (folder / "map.yaml").write_text(yaml.safe_dump({**header, **changes}))
    return folder / "map.yaml"


def room(rows=20, columns=30):
    """White with a black border, a closet in the upper left corner, and an unknown block at the right."""
    pixels = np.full((rows, columns), 254, np.uint8)
    pixels[[0, -1]] = pixels[:, [0, -1]] = 0
    pixels[5, :6] = pixels[:6, 5] = 0
    pixels[10:12, 20:22] = 205
    return pixels


def test_of_a_ros_map_the_largest_free_area_is_free_and_unknown_is_solid(tmp_path):
    floor = load_file(write_map(tmp_path, room(), origin=[1.0, -2.0, 0.0]))
    assert floor.name == "map"
    assert floor.bounds == pytest.approx((1.1, -1.9, 3.9, -0.1))
    free = free_of(floor, 0.1)
    # In the picture row 0 is the top: the closet is up left, so the last rows lack it.
    assert free.sum() == 18 * 28 - 25 - 4
    assert floor.starts.shape == (0, 3)


def test_a_ros_map_is_turned_by_the_yaw_of_its_origin(tmp_path):
    straight = load_file(write_map(tmp_path, room()))
    quarter = load_file(write_map(tmp_path, room(), origin=[0.0, 0.0, math.pi / 2]))
    np.testing.assert_allclose(
        quarter.bounds,
        (-straight.bounds[3], straight.bounds[0], -straight.bounds[1], straight.bounds[2]),
        atol=1e-6,
    )
    x, y = 2.55, 1.35
    solid = quarter.raster(0.1, 0.0, 1.0)
    column, row = (int((value - low) / 0.1) for value, low in zip((-y, x), solid.origin, strict=True))
    assert not solid.solid[row, column]


def test_walls_of_one_pixel_stay_closed_when_a_map_is_turned(tmp_path):
    for yaw in (0.1, 0.3, math.pi / 4, -2.0):
        floor = load_file(write_map(tmp_path, room(), origin=[0.0, 0.0, yaw]))
        area = free_of(floor, 0.025).sum() * 0.025**2
        assert area == pytest.approx((18 * 28 - 25 - 4) * 0.01, rel=0.03)


def test_a_plain_image_needs_a_resolution(tmp_path):
    pixels = room()
    pixels[pixels == 205] = 100
    cv2.imwrite(str(tmp_path / "plan.png"), pixels)
    with pytest.raises(ValueError, match="--resolution"):
        load_file(tmp_path / "plan.png")
    assert free_of(load_file(tmp_path / "plan.png", 0.1), 0.1).sum() == 18 * 28 - 25 - 4


def test_in_a_picture_with_the_greys_of_map_server_unknown_is_solid(tmp_path):
    cv2.imwrite(str(tmp_path / "plan.png"), room())
    assert free_of(load_file(tmp_path / "plan.png", 0.1), 0.1).sum() == 18 * 28 - 25 - 4


@pytest.mark.parametrize("grey", [0, 90, 255])
def test_an_image_of_one_colour_is_refused(tmp_path, grey):
    cv2.imwrite(str(tmp_path / "plain.png"), np.full((20, 20), grey, np.uint8))
    with pytest.raises(ValueError, match=r"all free|all solid"):
        load_file(tmp_path / "plain.png", 0.1)


@pytest.mark.parametrize("coloured", [True, False])
def test_a_dungeon_starts_at_its_mark_and_only_what_can_be_reached_is_free(tmp_path, coloured):
    pixels = np.full((48, 64, 3), 127, np.uint8)
    pixels[4:20, 4:60] = pixels[30:40, 4:12] = 195
    pixels[32:36, 6:10] = (0, 216, 255) if coloured else 208
    cv2.imwrite(str(tmp_path / "level.png"), pixels if coloured else pixels[..., 0])
    floor = load_file(tmp_path / "level.png")
    np.testing.assert_allclose(floor.starts, [[0.8, 1.4, 0.0]])
    assert free_of(floor, 0.1).sum() == 80


def test_arrays_are_read_with_their_rows_from_the_top_or_with_their_own_frame(tmp_path):
    np.save(tmp_path / "grid.npy", room())
    with pytest.raises(ValueError, match="--resolution"):
        load_file(tmp_path / "grid.npy")
    assert free_of(load_file(tmp_path / "grid.npy", 0.1), 0.1).any()
    np.savez(tmp_path / "grid.npz", solid=(room()[::-1] != 254), origin=(5.0, 6.0), resolution=0.1)
    floor = load_file(tmp_path / "grid.npz")
    assert free_of(floor, 0.1).sum() == 18 * 28 - 25 - 4
    assert floor.bounds == pytest.approx((5.1, 6.1, 7.9, 7.9))
    np.savez(tmp_path / "half.npz", solid=np.zeros((3, 3)))
    with pytest.raises(ValueError, match="no array origin, resolution"):
        load_file(tmp_path / "half.npz")


def test_houseexpo_is_free_within_its_polygon(tmp_path):
    corners = [[0.1, 0.1], [4.1, 0.1], [4.1, 2.1], [2.1, 2.1], [2.1, 4.1], [0.1, 4.1]]
    (tmp_path / "house.json").write_text(json.dumps({"verts": corners, "id": "house"}))
    floor = load_file(tmp_path / "house.json")
    assert free_of(floor).sum() * 0.05**2 == pytest.approx(12.0)


@pytest.mark.parametrize(
    "content",
    ["{}", "[1]", '{"verts": [[0, 0], [1, 1]]}', '{"verts": "none"}', '{"verts": [[0, 0], [1, "a"]]}', "{"],
)
def test_houseexpo_without_a_polygon_is_refused(tmp_path, content):
    (tmp_path / "house.json").write_text(content)
    with pytest.raises(ValueError, match=r"verts|JSON"):
        load_file(tmp_path / "house.json")


# Two rooms of 4 m x 4 m, 0.2 m apart, y down; a door of 1 m in the wall between them, the names of its
# targets unknown.
KTH_XML = """<?xml version="1.0" encoding="UTF-8"?>
<floor><Scale PixelDistance="100" RealDistance="1"/>
<space name="a"><contour>
<linesegment x1="0" y1="0" x2="400" y2="0" type="Wall" target=""/>
<linesegment x1="400" y1="0" x2="400" y2="100" type="Wall" target=""/>
<linesegment x1="400" y1="100" x2="400" y2="200" type="{kind}" target="x"/>
<linesegment x1="400" y1="200" x2="400" y2="400" type="Wall"/>
<linesegment x1="400" y1="400" x2="0" y2="400" type="Window"/>
<linesegment x1="0" y1="400" x2="0" y2="0" type="Wall" target=""/>
</contour></space>
<space name="b"><contour>
<linesegment x1="420" y1="0" x2="820" y2="0" type="Wall" target=""/>
<linesegment x1="820" y1="0" x2="820" y2="400" type="Wall" target=""/>
<linesegment x1="820" y1="400" x2="420" y2="400" type="Wall" target=""/>
<linesegment x1="420" y1="400" x2="420" y2="200" type="Wall"/>
<linesegment x1="420" y1="200" x2="420" y2="100" type="{other}" target="y"/>
<linesegment x1="420" y1="100" x2="420" y2="0" type="Wall"/>
</contour></space></floor>"""


@pytest.mark.parametrize(
    ("kind", "other", "area"), [("Portal", "Portal", 32.0), ("Portal", "Wall", 32.0), ("Wall", "Wall", 16.0)]
)
def test_a_portal_opens_the_wall_between_two_rooms(tmp_path, kind, other, area):
    (tmp_path / "floor.xml").write_text(KTH_XML.format(kind=kind, other=other))
    floor = load_file(tmp_path / "floor.xml")
    assert free_of(floor, 0.025).sum() * 0.025**2 == pytest.approx(area, rel=0.04)
    packed = tmp_path / "packed.xml.gz"
    packed.write_bytes(gzip.compress(KTH_XML.format(kind=kind, other=other).encode()))
    assert load_file(packed).sha256 == floor.sha256
    assert load_file(packed).name == "packed"


def test_y_of_a_kth_drawing_points_down(tmp_path):
    (tmp_path / "floor.xml").write_text(KTH_XML.format(kind="Portal", other="Portal"))
    assert load_file(tmp_path / "floor.xml").bounds[1] == pytest.approx(-4.0, abs=0.1)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("<floor><Scale PixelDistance='1' RealDistance='1'/></floor>", "no space"),
        ("<floor><space name='a'/></floor>", "no Scale"),
        ("<floor><Scale PixelDistance='0' RealDistance='1'/><space/></floor>", "has Scale"),
        ("<floor>", "not XML"),
        (
            "<floor><Scale PixelDistance='1' RealDistance='1'/><space name='a'><linesegment "
            "x1='1'/></space></floor>",
            "space 'a'",
        ),
        (KTH_XML.format(kind="Wall", other="Wall").replace("820", "nan"), "space 'b'"),
    ],
)
def test_a_kth_file_without_spaces_or_scale_is_refused(tmp_path, content, message):
    (tmp_path / "floor.xml").write_text(content)
    with pytest.raises(ValueError, match=message):
        load_file(tmp_path / "floor.xml")


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


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.txt", "0 0 1 0 wall\n", "doors give the scale"),
        ("a.txt", "0 0 1\n", "line 1"),
        ("a.txt", "", "0 walls"),
        ("a.vectormap.txt", "", "no lines"),
        ("a.vectormap.txt", "1,2,3,4\n1,2,x,4\n", "line 2"),
        ("a.vectormap.txt", "1,2,3,nan\n", "line 1"),
    ],
)
def test_text_that_is_no_drawing_is_refused(tmp_path, name, content, message):
    (tmp_path / name).write_text(content)
    with pytest.raises(ValueError, match=message):
        load_file(tmp_path / name)


def test_missing_files_folders_and_unknown_formats_are_refused(tmp_path):
    with pytest.raises(FileNotFoundError, match="no file"):
        load_file(tmp_path / "none.png")
    with pytest.raises(ValueError, match="folder"):
        load_file(tmp_path)
    (tmp_path / "floor.doc").write_text("")
    with pytest.raises(ValueError, match=r"no known floor format; want a file that ends in .*\.yaml"):
        load_file(tmp_path / "floor.doc")
    for name in ("a.png", "a.npy", "a.npz"):
        (tmp_path / name).write_bytes(b"nothing of the kind")
        with pytest.raises(ValueError, match=name):
            load_file(tmp_path / name, 0.1)


@pytest.mark.parametrize("name", ["a.xml.gz", "a.txt.gz", "a.vectormap.txt.gz", "a.json.gz"])
@pytest.mark.parametrize(
    "content",
    [gzip.compress(b"0,0,1,1\n" * 99, mtime=0)[:-9], b"not packed", gzip.compress(b"\xff\xfe\x00", mtime=0)],
)
def test_damaged_packed_files_are_refused(tmp_path, name, content):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(ValueError, match=r"damaged or truncated|not a text file"):
        load_file(tmp_path / name)


@pytest.mark.parametrize("resolution", [0.0, -0.05, math.nan, math.inf])
def test_a_resolution_that_is_not_positive_is_refused(tmp_path, resolution):
    with pytest.raises(ValueError, match="resolution is"):
        load_file(write_map(tmp_path, room()), resolution)


def test_a_resolution_for_a_file_with_its_own_scale_is_refused(tmp_path):
    with pytest.raises(ValueError, match="its own scale"):
        load_file(write_map(tmp_path, room()), 0.1)


@pytest.mark.parametrize("name", KTH)
def test_a_kth_floor_is_like_its_picture(shared_data, name):
    folder = shared_data / "floorplans" / "kth"
    about = json.loads((folder / "meta.json").read_text())[name]
    floor = load_file(folder / "xml" / f"{name}.xml.gz")
    free = free_of(floor)
    # The pictures have thicker walls, and the smaller areas of theirs may be connected in ours.
    assert about["conn"] * 0.98 < free.sum() / about["free_px"] < 1.12
    picture = cv2.imread(str(folder / "png" / f"{name}.png"), cv2.IMREAD_GRAYSCALE)[::-1] == 254
    ours, theirs = (
        grid[rows.min() : rows.max() + 1, columns.min() : columns.max() + 1]
        for grid in (free, picture)
        for rows, columns in [grid.nonzero()]
    )
    rows, columns = np.minimum(ours.shape, theirs.shape)
    if about["conn"] == 1.0:
        assert (ours[:rows, :columns] == theirs[:rows, :columns]).mean() > 0.93


def test_apartments_are_connected_and_have_the_size_that_is_known(shared_data):
    folder = shared_data / "floorplans" / "lifull"
    about = json.loads((folder / "meta.json").read_text())
    for name in sorted(about)[::12]:
        floor = load_file(folder / "txt" / f"{name}.txt")
        assert connectivity(free_of(floor, 0.025)) > about[name]["conn"] - 0.03
        width, height = floor.bounds[2] - floor.bounds[0] - 0.1, floor.bounds[3] - floor.bounds[1] - 0.1
        assert (width, height) == pytest.approx((about[name]["width_m"], about[name]["height_m"]), rel=0.02)


def test_every_dungeon_has_a_start_in_free_space(shared_data):
    for path in sorted((shared_data / "floorplans" / "synthetic_dungeon").glob("*.png")):
        floor = load_file(path)
        raster = floor.raster(0.1, 0.0, 1.0)
        (x, y, _) = floor.starts[0]
        assert raster.solid[int((y - raster.origin[1]) / 0.1), int((x - raster.origin[0]) / 0.1)] == 0
        assert 500.0 < (raster.solid == 0).sum() * 0.01 < 1000.0


@pytest.mark.parametrize("name", SLAM_MAPS)
def test_maps_made_by_robots_become_one_connected_floor(shared_data, name):
    free = free_of(load_file(shared_data / "slam_maps" / f"{name}.yaml"), 0.025)
    assert connectivity(free) > 0.999
    assert free.sum() * 0.025**2 > 25.0


@pytest.mark.parametrize(("name", "area"), [("GDC3", 3016.0), ("ASE1", 860.0)])
def test_a_building_of_wall_lines_is_free_inside_only(shared_data, name, area):
    floor = load_file(shared_data / "floorplans" / "amrl" / f"{name}.vectormap.txt.gz")
    assert free_of(floor).sum() * 0.05**2 == pytest.approx(area, rel=0.06)


def test_houses_are_connected(shared_data):
    for path in sorted((shared_data / "floorplans" / "houseexpo").glob("*.json")):
        assert connectivity(free_of(load_file(path), 0.025)) > 0.999
