"""Levels of a map from the pixels of its picture."""

import logging

import cv2
import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from lidarium.envs.floors.free_space import measure_building
from lidarium.envs.floors.importers import load_file
from lidarium.mapping.files import map_files
from lidarium.mapping.files.images import read_image
from lidarium.mapping.files.map_files import (
    FREE,
    MAP_SERVER_GREYS,
    MAX_YAML_BYTES,
    MIDDLE_GREYS,
    OCCUPIED,
    UNKNOWN,
    _levels_by_blocks,
    _levels_of,
    _raw_levels,
    _read_yaml,
    read_grey_map,
    read_ros_map,
    unknown_grey,
    write_ros_map,
)


def trinary(shades):
    return _levels_of(shades, negate=False, low=0.2, high=0.65)


def test_thresholds_are_of_occupancy_and_are_themselves_unknown():
    shades = np.array([[0.0, 255.0 * 0.34, 255.0 * 0.35, 255.0 * 0.8, 255.0 * 0.81, 255.0]])
    assert trinary(shades).tolist() == [[OCCUPIED, OCCUPIED, UNKNOWN, UNKNOWN, FREE, FREE]]
    negated = _levels_of(255.0 - shades, negate=True, low=0.2, high=0.65)
    np.testing.assert_array_equal(negated, trinary(shades))


def test_a_grey_that_stands_for_unknown_is_that_whatever_the_thresholds():
    shades = np.array([[204.0, 205.0, 205.6]])
    assert _levels_of(shades, negate=False, low=0.3, high=0.65, unknown=205).tolist() == [[FREE, UNKNOWN, FREE]]


def test_raw_pixels_are_percent_of_occupancy():
    shades = np.array([[0.0, 19.0, 20.0, 65.0, 66.0, 100.0, 101.0, 255.0]])
    expected = [FREE, FREE, UNKNOWN, UNKNOWN, OCCUPIED, OCCUPIED, UNKNOWN, UNKNOWN]
    assert _raw_levels(shades, 0.2, 0.65).tolist() == [expected]


@pytest.mark.parametrize("channels", [1, 3])
def test_greys_colours_and_sixteen_bits_give_the_same_levels(channels):
    grey = np.array([[0, 128, 255]], np.uint8)
    pixels = grey if channels == 1 else np.repeat(grey[..., None], 3, axis=2)
    expected = trinary(grey.astype(float))
    np.testing.assert_array_equal(_levels_by_blocks(pixels, trinary, "ignored"), expected)
    deep = pixels.astype(np.uint16) * np.uint16(257)
    np.testing.assert_array_equal(_levels_by_blocks(deep, trinary, "ignored"), expected)


def test_what_is_not_opaque_is_unknown_where_that_is_asked_for():
    pixels = np.zeros((1, 3, 4), np.uint8)
    pixels[..., 3] = [[255, 254, 0]]
    assert _levels_by_blocks(pixels, trinary, "unknown").tolist() == [[OCCUPIED, UNKNOWN, UNKNOWN]]
    assert _levels_by_blocks(pixels, trinary, "ignored").tolist() == [[OCCUPIED] * 3]


def test_blocks_make_no_difference(monkeypatch):
    pixels = np.random.default_rng(0).integers(0, 256, (50, 40, 2)).astype(np.uint8)
    whole = _levels_by_blocks(pixels, trinary, "unknown")
    monkeypatch.setattr(map_files, "_BLOCK_PIXELS", 130)
    np.testing.assert_array_equal(_levels_by_blocks(pixels, trinary, "unknown"), whole)


def test_values_are_read(tmp_path):
    (tmp_path / "a.yaml").write_text("image: map.png\nresolution: 0.05\norigin: [1, 2.5, 0]\n")
    assert _read_yaml(tmp_path / "a.yaml") == {"image": "map.png", "resolution": 0.05, "origin": [1, 2.5, 0]}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a: &x [1]\nb: *x\n", r"has an alias"),
        ("a: [1, 2\n", "a.yaml is not a yaml file"),
        ("a: !!python/object/apply:os.system ['true']\n", "a.yaml is not a yaml file"),
        ("# " + "x" * MAX_YAML_BYTES, "want at most 16,384"),
    ],
)
def test_what_is_no_short_header_is_refused_by_name(tmp_path, text, message):
    (tmp_path / "a.yaml").write_text(text)
    with pytest.raises(ValueError, match=message):
        _read_yaml(tmp_path / "a.yaml")


def test_a_missing_header_is_missing(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"there is no file .*a\.yaml"):
        _read_yaml(tmp_path / "a.yaml")


HEADER = {
    "image": "map.pgm",
    "mode": "trinary",
    "resolution": 0.05,
    "origin": [0.0, 0.0, 0.0],
    "negate": 0,
    "occupied_thresh": 0.65,
    "free_thresh": 0.25,
}


def greys(unknown=205, free=254):
    """A room of 2 x 3 m with walls, unknown around it."""
    pixels = np.full((80, 100), unknown, np.uint8)
    pixels[18:62, 18:82] = 0
    pixels[20:60, 20:80] = free
    return pixels


def write(folder, pixels, **changes):
    name = changes.pop("file", "map.pgm")
    assert cv2.imwrite(str(folder / name), pixels)
    (folder / "map.yaml").write_text(yaml.safe_dump({**HEADER, "image": name, **changes}))
    return folder / "map.yaml"


def area(floor):
    return float((floor.cells.solid == 0).sum()) * floor.cells.resolution**2


@pytest.mark.parametrize("free", [254, 255])
@pytest.mark.parametrize("free_thresh", [0.196, 0.25])
def test_what_map_saver_writes_for_unknown_is_unknown_whatever_the_threshold(tmp_path, free, free_thresh):
    image = read_ros_map(write(tmp_path, greys(free=free), free_thresh=free_thresh))
    assert (image.levels == 127).sum() == (greys() == 205).sum()
    assert area(load_file(tmp_path / "map.yaml")) == pytest.approx(6.0)


def test_a_grey_among_its_neighbours_is_what_the_thresholds_say(tmp_path):
    ramp = np.tile(np.arange(156, 256, dtype=np.uint8), (80, 1))
    image = read_ros_map(write(tmp_path, ramp))
    assert (image.levels[:, 205 - 156] == 255).all()
    assert unknown_grey(ramp, (MAP_SERVER_GREYS, MIDDLE_GREYS)) is None


@pytest.mark.parametrize(("unknown", "free"), [(205, 255), (128, 255), (127, 254), (206, 254), (204, 254)])
def test_greys_of_unknown_in_plain_images_are_unknown(tmp_path, unknown, free):
    cv2.imwrite(str(tmp_path / "map.png"), greys(unknown, free))
    levels = read_grey_map(tmp_path / "map.png", 0.05).levels
    assert (levels == 127).sum() == (greys() == 205).sum()
    assert area(load_file(tmp_path / "map.png", 0.05)) == pytest.approx(6.0)


@pytest.mark.parametrize("most", [1, 15, 100, 255, 1000, 65535])
@pytest.mark.parametrize("kind", ["P5", "P2"])
def test_white_is_what_a_pgm_calls_white(tmp_path, most, kind):
    pixels = np.where(greys() == 254, most, 0)
    pixels[30, 40] = most // 2
    head = f"{kind}\n# a remark\n{pixels.shape[1]} {pixels.shape[0]}\n{most}\n".encode()
    body = (
        " ".join(map(str, pixels.ravel().tolist())).encode()
        if kind == "P2"
        else pixels.astype(">u2" if most > 255 else np.uint8).tobytes()
    )
    (tmp_path / "map.pgm").write_bytes(head + body)
    found = read_image(tmp_path / "map.pgm")
    white = np.iinfo(found.dtype).max
    np.testing.assert_allclose(found / white, pixels / most, atol=0.01)
    (tmp_path / "map.yaml").write_text(yaml.safe_dump(HEADER))
    assert (read_ros_map(tmp_path / "map.yaml").levels == 255).sum() == 40 * 60 - 1


@pytest.mark.parametrize("white", [1.0, 255.0])
def test_float_pixels_are_shares_of_white_or_greys(tmp_path, white):
    shades = np.where(greys() == 205, 205.0 / 255.0, greys() / 254.0).astype(np.float32)
    image = read_ros_map(write(tmp_path, shades * np.float32(white), file="map.tif"))
    assert [(image.levels == level).sum() for level in (0, 127, 255)] == [
        (greys() == grey).sum() for grey in (0, 205, 254)
    ]


@pytest.mark.parametrize("value", [-1.0, 256.0, np.nan, np.inf])
def test_other_float_pixels_are_refused_by_the_name_of_the_file(tmp_path, value):
    shades = np.ones((4, 4), np.float32)
    shades[1, 1] = value
    path = write(tmp_path, shades, file="map.tif")
    with pytest.raises(ValueError, match=r"map\.tif has float pixels .* want 0 to 1 or 0 to 255"):
        read_ros_map(path)


@pytest.mark.parametrize("name", ["/home/user/maps/map.pgm", "maps/map.pgm", "~/map.pgm", r"C:\robot\maps\map.pgm"])
def test_an_image_beside_the_header_is_used_where_its_path_leads_nowhere(tmp_path, caplog, name):
    path = write(tmp_path, greys())
    header = yaml.safe_load(path.read_text())
    path.write_text(yaml.safe_dump({**header, "image": name}))
    with caplog.at_level(logging.WARNING):
        assert (read_ros_map(path).levels == 255).sum() == 40 * 60
    assert "map.pgm beside it is used" in caplog.text


def test_where_no_image_is_beside_it_the_header_and_the_cure_are_named(tmp_path):
    (tmp_path / "map.yaml").write_text(yaml.safe_dump({**HEADER, "image": "/home/user/map.pgm"}))
    with pytest.raises(FileNotFoundError, match=r"map\.yaml names it as its image: put the image beside it"):
        read_ros_map(tmp_path / "map.yaml")


SHARED = {
    "nav2-unknown-is-free/flat.yaml": 63.5,
    "float-image/float.yaml": 63.0,
    "image-path-of-another-machine/absolute.yaml": 63.5,
    "image-path-of-another-machine/subfolder.yaml": 63.5,
    "image-path-of-another-machine/tilde.yaml": 63.5,
    "pgm-maxval/max15.yaml": 63.0,
    "pgm-maxval/max100.yaml": 63.0,
    "pgm-maxval/max100_ascii.yaml": 63.0,
    "pgm-maxval/max255.yaml": 63.0,
    "pgm-maxval/max1000.yaml": 63.0,
    "outside-larger-than-inside/track.yaml": 41.2,
    "grey-unknown-in-images/unknown128.png": 63.5,
    "grey-unknown-in-images/unknown205_free255.pgm": 63.5,
    "grey-unknown-in-images/unknown206.pgm": 63.5,
}


@pytest.mark.parametrize("name", SHARED)
def test_maps_of_other_programs_have_the_right_area(shared_cases, name):
    floor = load_file(shared_cases / name, None if name.endswith("yaml") else 0.05)
    assert measure_building(floor).area_m2 == pytest.approx(SHARED[name], abs=0.05)


def test_an_area_along_the_border_of_a_picture_is_told_to_be_outside(shared_cases):
    floor = load_file(shared_cases / "outside-larger-than-inside" / "track.yaml")
    assert "free space along the picture's border was taken for outside" in floor.remark


HEADER_OF_MAP_FILES = {
    "image": "map.png",
    "resolution": 0.05,
    "origin": [1.0, 2.0, 0.5],
    "negate": 0,
    "occupied_thresh": 0.65,
    "free_thresh": 0.196,
}


def write_of_map_files(folder, pixels, **changes):
    cv2.imwrite(str(folder / "map.png"), np.asarray(pixels, np.uint8))
    header = {key: value for key, value in {**HEADER_OF_MAP_FILES, **changes}.items() if value is not ...}
    (folder / "map.yaml").write_text(yaml.safe_dump(header))
    return folder / "map.yaml"


@settings(max_examples=25)
@given(arrays(np.uint8, array_shapes(min_dims=2, max_dims=2, max_side=20), elements=st.sampled_from([0, 127, 255])))
def test_a_map_written_reads_back_the_same(tmp_path_factory, levels):
    folder = tmp_path_factory.mktemp("maps")
    path = write_ros_map(folder, "office", levels, (-1.25, 3.5, 0.25), 0.05)
    back = read_ros_map(path)
    np.testing.assert_array_equal(back.levels, levels)
    assert back.origin == (-1.25, 3.5, 0.25)
    assert back.resolution == 0.05
    assert sorted(file.name for file in folder.iterdir()) == ["office.pgm", "office.yaml"]


def test_the_first_row_of_the_image_is_the_largest_y(tmp_path):
    path = write_ros_map(
        tmp_path / "new" / "folder", "map", np.array([[0, 0], [255, 127]], np.uint8), (0.0, 0.0, 0.0), 0.1
    )
    pixels = read_image(path.with_suffix(".pgm"))
    np.testing.assert_array_equal(pixels, [[254, 205], [0, 0]])


def test_trinary_pixels_are_split_by_the_thresholds(tmp_path):
    image = read_ros_map(write_of_map_files(tmp_path, [[0, 89, 90, 205, 206, 255]]))
    np.testing.assert_array_equal(image.levels, [[0, 0, 127, 127, 255, 255]])
    assert image.origin == (1.0, 2.0, 0.5)


def test_negate_turns_white_into_occupied(tmp_path):
    np.testing.assert_array_equal(
        read_ros_map(write_of_map_files(tmp_path, [[0, 127, 255]], negate=1)).levels, [[255, 127, 0]]
    )


def test_scale_mode_leaves_the_middle_and_the_transparent_unknown(tmp_path):
    pixels = np.zeros((1, 3, 4), np.uint8)
    pixels[0] = [[0, 0, 0, 255], [255, 255, 255, 255], [255, 255, 255, 0]]
    np.testing.assert_array_equal(
        read_ros_map(write_of_map_files(tmp_path, pixels, mode="scale")).levels, [[0, 255, 127]]
    )
    raw = read_ros_map(write_of_map_files(tmp_path, pixels, mode="raw"))
    np.testing.assert_array_equal(raw.levels, [[255, 127, 127]])


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_opacity_is_a_fourth_colour_in_trinary_mode(tmp_path, dtype):
    pixels = np.zeros((4, 50, 4), dtype)
    pixels[..., :3] = np.array([0, 254, 254, 205], dtype)[:, None, None] * (1 if dtype == np.uint8 else 257)
    pixels[..., 3] = np.iinfo(dtype).max
    pixels[2, :, 3] = 0
    levels = read_ros_map(write_of_map_files(tmp_path, pixels)).levels
    np.testing.assert_array_equal(levels[::-1, 0], [OCCUPIED, FREE, UNKNOWN, UNKNOWN])


def test_raw_pixels_are_occupancy_in_percent(tmp_path):
    image = read_ros_map(write_of_map_files(tmp_path, [[0, 19, 20, 65, 66, 100, 101, 255]], mode="raw"))
    np.testing.assert_array_equal(image.levels, [[255, 255, 127, 127, 0, 0, 127, 127]])


def test_colours_and_sixteen_bits_are_read_as_grey(tmp_path):
    path = write_of_map_files(tmp_path, np.full((2, 2, 3), 254))
    assert (read_ros_map(path).levels == 255).all()
    cv2.imwrite(str(tmp_path / "map.png"), np.full((2, 2), 65535, np.uint16))
    assert (read_ros_map(path).levels == 255).all()


@pytest.mark.parametrize("key", sorted(HEADER_OF_MAP_FILES))
def test_a_missing_key_is_named(tmp_path, key):
    with pytest.raises(ValueError, match=f"no key {key}"):
        read_ros_map(write_of_map_files(tmp_path, [[0, 255]], **{key: ...}))


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("resolution", 0),
        ("resolution", -0.05),
        ("resolution", "fine"),
        ("origin", [0.0, 0.0]),
        ("origin", "here"),
        ("origin", [0.0, float("nan"), 0.0]),
        ("mode", "colour"),
        ("negate", "maybe"),
        ("occupied_thresh", 0.1),
        ("free_thresh", float("nan")),
    ],
)
def test_a_bad_value_is_named(tmp_path, key, value):
    with pytest.raises(ValueError, match=key):
        read_ros_map(write_of_map_files(tmp_path, [[0, 255]], **{key: value}))


def test_missing_files_and_folders_are_told_apart(tmp_path):
    with pytest.raises(FileNotFoundError, match="no file"):
        read_ros_map(tmp_path / "none.yaml")
    with pytest.raises(ValueError, match="folder"):
        read_ros_map(tmp_path)
    path = write_of_map_files(tmp_path, [[0, 255]])
    (tmp_path / "map.png").unlink()
    with pytest.raises(FileNotFoundError, match=r"map\.png"):
        read_ros_map(path)


@pytest.mark.parametrize("text", ["", "just words", "a: [1", "- 1\n- 2\n"])
def test_what_is_no_header_is_refused(tmp_path, text):
    (tmp_path / "map.yaml").write_text(text)
    with pytest.raises(ValueError, match=r"map\.yaml"):
        read_ros_map(tmp_path / "map.yaml")


@pytest.mark.parametrize("content", [b"", b"no image", b"\x89PNG\r\n\x1a\n"])
def test_what_is_no_image_is_refused(tmp_path, content):
    path = write_of_map_files(tmp_path, [[0, 255]])
    (tmp_path / "map.png").write_bytes(content)
    with pytest.raises(ValueError, match="not an image"):
        read_ros_map(path)


@pytest.mark.parametrize(
    ("levels", "origin", "resolution"),
    [
        (np.full((2, 2), 3, np.uint8), (0.0, 0.0, 0.0), 0.1),
        (np.zeros((0, 2), np.uint8), (0.0, 0.0, 0.0), 0.1),
        (np.zeros((2, 2), np.uint8), (0.0, 0.0), 0.1),
        (np.zeros((2, 2), np.uint8), (0.0, 0.0, np.inf), 0.1),
        (np.zeros((2, 2), np.uint8), (0.0, 0.0, 0.0), 0.0),
    ],
)
def test_bad_maps_are_refused_before_anything_is_written(tmp_path, levels, origin, resolution):
    with pytest.raises(ValueError, match="map 'bad'"):
        write_ros_map(tmp_path, "bad", levels, origin, resolution)
    assert not list(tmp_path.iterdir())


def test_every_map_that_robots_made_is_read(shared_data):
    paths = sorted((shared_data / "slam_maps").glob("*.yaml"))
    assert paths
    for path in paths[::3]:
        image = read_ros_map(path)
        assert {0, 255} <= set(np.unique(image.levels)) <= {0, 127, 255}
