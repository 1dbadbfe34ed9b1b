import cv2
import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from lidarium.mapping.files.images import read_image
from lidarium.mapping.files.map_files import read_ros_map, write_ros_map

HEADER = {
    "image": "map.png",
    "resolution": 0.05,
    "origin": [1.0, 2.0, 0.5],
    "negate": 0,
    "occupied_thresh": 0.65,
    "free_thresh": 0.196,
}


def write(folder, pixels, **changes):
    cv2.imwrite(str(folder / "map.png"), np.asarray(pixels, np.uint8))
    header = {key: value for key, value in {**HEADER, **changes}.items() if value is not ...}
    (folder / "map.yaml").write_text(yaml.safe_dump(header))
    return folder / "map.yaml"


@settings(max_examples=25)
@given(
    arrays(
        np.uint8, array_shapes(min_dims=2, max_dims=2, max_side=20), elements=st.sampled_from([0, 127, 255])
    )
)
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
    image = read_ros_map(write(tmp_path, [[0, 89, 90, 205, 206, 255]]))
    np.testing.assert_array_equal(image.levels, [[0, 0, 127, 127, 255, 255]])
    assert image.origin == (1.0, 2.0, 0.5)


def test_negate_turns_white_into_occupied(tmp_path):
    np.testing.assert_array_equal(
        read_ros_map(write(tmp_path, [[0, 127, 255]], negate=1)).levels, [[255, 127, 0]]
    )


def test_scale_mode_leaves_the_middle_and_the_transparent_unknown(tmp_path):
    pixels = np.zeros((1, 3, 4), np.uint8)
    pixels[0] = [[0, 0, 0, 255], [255, 255, 255, 255], [255, 255, 255, 0]]
    np.testing.assert_array_equal(read_ros_map(write(tmp_path, pixels, mode="scale")).levels, [[0, 255, 127]])
    np.testing.assert_array_equal(read_ros_map(write(tmp_path, pixels)).levels, [[0, 255, 255]])


def test_raw_pixels_are_occupancy_in_percent(tmp_path):
    image = read_ros_map(write(tmp_path, [[0, 19, 20, 65, 66, 100, 101, 255]], mode="raw"))
    np.testing.assert_array_equal(image.levels, [[255, 255, 127, 127, 0, 0, 127, 127]])


def test_colours_and_sixteen_bits_are_read_as_grey(tmp_path):
    path = write(tmp_path, np.full((2, 2, 3), 254))
    assert (read_ros_map(path).levels == 255).all()
    cv2.imwrite(str(tmp_path / "map.png"), np.full((2, 2), 65535, np.uint16))
    assert (read_ros_map(path).levels == 255).all()


@pytest.mark.parametrize("key", sorted(HEADER))
def test_a_missing_key_is_named(tmp_path, key):
    with pytest.raises(ValueError, match=f"no key {key}"):
        read_ros_map(write(tmp_path, [[0, 255]], **{key: ...}))


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
        read_ros_map(write(tmp_path, [[0, 255]], **{key: value}))


def test_missing_files_and_folders_are_told_apart(tmp_path):
    with pytest.raises(FileNotFoundError, match="no file"):
        read_ros_map(tmp_path / "none.yaml")
    with pytest.raises(ValueError, match="folder"):
        read_ros_map(tmp_path)
    path = write(tmp_path, [[0, 255]])
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
    path = write(tmp_path, [[0, 255]])
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
