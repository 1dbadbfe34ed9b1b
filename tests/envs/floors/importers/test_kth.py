"""Floors of the KTH campus."""

import gzip
import json

import cv2
import numpy as np
import pytest
from imported_floors import free_of

from lidarium.envs.floors.importers import load_file

# Small floors of the real sets whose pictures are connected (meta.json: conn).
KTH = [
    "A0043001__0510034691_Layout1",
    "A0043002__50057024",
    "A0050018__0510034880_A-40",
    "A0043018__0510040941_A-40.1-805",
]


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
            "<floor><Scale PixelDistance='1' RealDistance='1'/><space name='a'><linesegment x1='1'/></space></floor>",
            "space 'a'",
        ),
        (KTH_XML.format(kind="Wall", other="Wall").replace("820", "nan"), "space 'b'"),
    ],
)
def test_a_kth_file_without_spaces_or_scale_is_refused(tmp_path, content, message):
    (tmp_path / "floor.xml").write_text(content)
    with pytest.raises(ValueError, match=message):
        load_file(tmp_path / "floor.xml")


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
