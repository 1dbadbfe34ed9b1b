"""Maps whose greys, sizes of white or paths are as other programs write them."""

import logging

import cv2
import numpy as np
import pytest
import yaml

from lidarium.envs.floors.importers import load_file
from lidarium.envs.floors.measures import measure_building
from lidarium.mapping.files.images import read_image
from lidarium.mapping.files.map_files import read_grey_map, read_ros_map
from lidarium.mapping.files.mending.unknown_greys import MAP_SERVER_GREYS, MIDDLE_GREYS, unknown_grey

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


@pytest.mark.parametrize(
    "name", ["/home/user/maps/map.pgm", "maps/map.pgm", "~/map.pgm", r"C:\robot\maps\map.pgm"]
)
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
