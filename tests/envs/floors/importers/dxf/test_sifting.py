"""Straight walls are read without a parser, just as a parser reads them."""

import io

import numpy as np
import pytest

from lidarium.envs.floors.importers import load_file
from lidarium.envs.floors.importers.dxf import drawing as drawing_module
from lidarium.envs.floors.importers.dxf.sifting import Sifted, sift

ezdxf = pytest.importorskip("ezdxf", reason="ezdxf is not installed: extra [dxf]")


def text_of(document):
    stream = io.StringIO()
    document.write(stream)
    return stream.getvalue()


@pytest.fixture(params=["R12", "R2000", "R2018"])
def document(request):
    """A room with walls of each straight kind, a door and a label."""
    made = ezdxf.new(request.param, units=6)
    space = made.modelspace()
    made.layers.add("WALLS")
    space.add_polyline2d([(0, 0), (6, 0), (6, 4), (0, 4)], close=True)
    space.add_polyline2d([(3, 0), (3, 1), (4, 1)])
    space.add_line((0, 2), (2, 2, 1), {"layer": "WALLS"})
    if request.param != "R12":
        space.add_lwpolyline([(4, 3), (5, 3), (5, 2)], close=True)
    space.add_arc((3, 2), 0.8, 0, 90)
    space.add_text("office")
    return made


def test_what_is_read_here_is_what_a_parser_reads(document, tmp_path, monkeypatch):
    document.saveas(tmp_path / "plan.dxf")
    resolution = 1.0 if document.dxfversion == "AC1009" else None  # R12 has no units
    sifted = load_file(tmp_path / "plan.dxf", resolution)
    monkeypatch.setattr(drawing_module, "sift", Sifted)
    parsed = load_file(tmp_path / "plan.dxf", resolution)
    assert sifted.bounds == parsed.bounds

    def corners(floor):
        return sorted(solid.polygon.tolist() for solid in floor.solids)

    assert corners(sifted) == corners(parsed)


def test_straight_walls_leave_the_text_and_so_do_labels(document):
    found = sift(text_of(document))
    assert [layer for layer, _ in found.walls[:3]] == ["0", "0", "WALLS"]
    assert found.walls[0][1].tolist() == [[0, 0], [6, 0], [6, 4], [0, 4], [0, 0]]
    assert found.walls[2][1].tolist() == [[0, 2], [2, 2]]
    left = ezdxf.read(io.StringIO(found.text)).modelspace()
    assert [entity.dxftype() for entity in left] == ["ARC"]
    assert found.entities < sift(text_of(document)).entities + 1


def test_entities_that_are_not_plain_are_left():
    document = ezdxf.new("R2000", units=6)
    space = document.modelspace()
    space.add_lwpolyline([(0, 0, 1.0), (1, 0, 0.0)], format="xyb")
    space.add_polyline2d([(0, 0, 1.0), (1, 0, 0.0)], format="xyb")
    space.add_polyline3d([(0, 0, 0), (1, 0, 1)])
    space.add_line((0, 0), (1, 0), {"extrusion": (0, 0, -1)})
    space.add_line((0, 0), (1, 0), {"invisible": 1})
    document.paperspace().add_line((0, 0), (1, 0))
    found = sift(text_of(document))
    assert not found.walls
    assert len(ezdxf.read(io.StringIO(found.text)).modelspace()) == 5


@pytest.mark.parametrize(
    "line",
    [
        "0 LINE 8 0 10 0 20 0 11 1 ",  # without an end
        "0 LINE 8 0 10 0 20 0 11 1 21 x ",
        "0 LINE 8 0 10 0 20 0 11 1 21 1 10 2 ",  # with two beginnings
        "0 LWPOLYLINE 90 2 10 0 20 0 10 1 ",
        "0 LWPOLYLINE 90 1 10 0 20 0 ",
        "0 POLYLINE 66 1 0 VERTEX 10 0 20 0 0 VERTEX 10 0 20 0 ",  # not closed by SEQEND
        "0 POLYLINE 66 1 0 VERTEX 10 0 20 0 0 SEQEND ",
    ],
)
def test_damaged_walls_are_left_for_a_parser(line):
    text = f"0 SECTION 2 ENTITIES {line}0 ENDSEC 0 EOF ".replace(" ", "\n")
    assert sift(text) == Sifted(text)


@pytest.mark.parametrize(
    "text", ["", "\n", "0", "no drawing\nEOF\n", "0\nSECTION\n2\nENTITIES", "0\nLINE\n" * 3]
)
def test_what_is_no_drawing_stays_as_it_is(text):
    assert sift(text) == Sifted(text)


def test_what_is_not_in_the_section_of_entities_stays():
    wall = "0 LINE 8 0 10 0 20 0 11 1 21 1 "
    sections = (f"0 SECTION 2 {name} {wall}0 ENDSEC " for name in ("BLOCKS", "ENTITIES", "OBJECTS"))
    found = sift("".join([*sections, "0 EOF "]).replace(" ", "\n"))
    np.testing.assert_array_equal([wall for _, wall in found.walls], [[[0, 0], [1, 1]]])
    assert found.text.count("LINE") == 2
    assert found.entities == 9
