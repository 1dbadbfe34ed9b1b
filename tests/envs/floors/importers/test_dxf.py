"""Straight walls are read without a parser, just as a parser reads them."""

import io
import math

import numpy as np
import pytest

from lidarium.envs.floors.catalogue.names import describe_floor
from lidarium.envs.floors.importers import dxf as drawing_module
from lidarium.envs.floors.importers import load_file, takes_resolution
from lidarium.envs.floors.importers.dxf import _sift, _Sifted

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
    monkeypatch.setattr(drawing_module, "_sift", _Sifted)
    parsed = load_file(tmp_path / "plan.dxf", resolution)
    assert sifted.bounds == parsed.bounds

    def corners(floor):
        return sorted(solid.polygon.tolist() for solid in floor.solids)

    assert corners(sifted) == corners(parsed)


def test_straight_walls_leave_the_text_and_so_do_labels(document):
    found = _sift(text_of(document))
    assert [layer for layer, _ in found.walls[:3]] == ["0", "0", "WALLS"]
    assert found.walls[0][1].tolist() == [[0, 0], [6, 0], [6, 4], [0, 4], [0, 0]]
    assert found.walls[2][1].tolist() == [[0, 2], [2, 2]]
    left = ezdxf.read(io.StringIO(found.text)).modelspace()
    assert [entity.dxftype() for entity in left] == ["ARC"]
    assert found.entities < _sift(text_of(document)).entities + 1


def test_entities_that_are_not_plain_are_left():
    document = ezdxf.new("R2000", units=6)
    space = document.modelspace()
    space.add_lwpolyline([(0, 0, 1.0), (1, 0, 0.0)], format="xyb")
    space.add_polyline2d([(0, 0, 1.0), (1, 0, 0.0)], format="xyb")
    space.add_polyline3d([(0, 0, 0), (1, 0, 1)])
    space.add_line((0, 0), (1, 0), {"extrusion": (0, 0, -1)})
    space.add_line((0, 0), (1, 0), {"invisible": 1})
    document.paperspace().add_line((0, 0), (1, 0))
    found = _sift(text_of(document))
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
    assert _sift(text) == _Sifted(text)


@pytest.mark.parametrize("text", ["", "\n", "0", "no drawing\nEOF\n", "0\nSECTION\n2\nENTITIES", "0\nLINE\n" * 3])
def test_what_is_no_drawing_stays_as_it_is(text):
    assert _sift(text) == _Sifted(text)


def test_what_is_not_in_the_section_of_entities_stays():
    wall = "0 LINE 8 0 10 0 20 0 11 1 21 1 "
    sections = (f"0 SECTION 2 {name} {wall}0 ENDSEC " for name in ("BLOCKS", "ENTITIES", "OBJECTS"))
    found = _sift("".join([*sections, "0 EOF "]).replace(" ", "\n"))
    np.testing.assert_array_equal([wall for _, wall in found.walls], [[[0, 0], [1, 1]]])
    assert found.text.count("LINE") == 2
    assert found.entities == 9


@pytest.fixture
def drawing():
    """A room of 6 by 4 m in millimetres."""
    document = ezdxf.new(units=4)
    corners = [(0, 0), (6000, 0), (6000, 4000), (0, 4000)]
    document.modelspace().add_lwpolyline(corners, close=True)
    return document


def saved(document, tmp_path, name="plan.dxf"):
    document.saveas(tmp_path / name)
    return tmp_path / name


def free_area(floor):
    return float((floor.raster(0.025, 0.3, 0.3).solid == 0).sum()) * 0.025**2


def test_a_room_is_as_large_as_its_unit_says(drawing, tmp_path):
    floor = load_file(saved(drawing, tmp_path))
    assert floor.name == "plan"
    # Walls are 0.1 m thick along their lines.
    assert floor.bounds == pytest.approx((-0.05, -0.05, 6.05, 4.05))
    assert free_area(floor) == pytest.approx(5.9 * 3.9, rel=0.01)
    assert not takes_resolution(tmp_path / "plan.dxf")


@pytest.mark.parametrize(("number", "metres"), [(1, 0.0254), (2, 0.3048), (5, 0.01), (6, 1.0)])
def test_other_units_are_metres_too(tmp_path, number, metres):
    document = ezdxf.new(units=number)
    wide, high = 6.0 / metres, 4.0 / metres
    document.modelspace().add_lwpolyline([(0, 0), (wide, 0), (wide, high), (0, high)], close=True)
    assert load_file(saved(document, tmp_path)).bounds == pytest.approx((-0.05, -0.05, 6.05, 4.05))


def test_lines_and_curves_are_walls_and_the_rest_is_not(drawing, tmp_path):
    space = drawing.modelspace()
    space.add_line((2000, 0), (2000, 3000))
    space.add_circle((4000, 2000), 500)
    space.add_text("office")
    space.add_hatch()
    floor = load_file(saved(drawing, tmp_path))
    # The inside of the circle is free, though no robot gets there: a line drawing has no insides.
    removed = 0.1 * 2.95 + math.pi * (0.55**2 - 0.45**2)
    assert free_area(floor) == pytest.approx(5.9 * 3.9 - removed, rel=0.01)


def test_blocks_are_taken_apart_where_they_are_inserted(drawing, tmp_path):
    desk = drawing.blocks.new("DESK")
    desk.add_lwpolyline([(0, 0), (100, 0)])
    drawing.modelspace().add_blockref("DESK", (1000, 1000), {"xscale": 20, "yscale": 20, "rotation": 90})
    floor = load_file(saved(drawing, tmp_path))
    ends = [solid.polygon for solid in floor.solids if abs(solid.polygon[:, 0].mean() - 1.0) < 1e-6]
    assert len(ends) == 1
    assert ends[0][:, 1].min() == pytest.approx(0.95)
    assert ends[0][:, 1].max() == pytest.approx(3.05)


def test_layers_that_are_off_or_frozen_are_left_out(drawing, tmp_path):
    drawing.layers.add("furniture").off()
    drawing.layers.add("old").freeze()
    for layer in ("furniture", "old"):
        drawing.modelspace().add_line((0, 2000), (6000, 2000), {"layer": layer})
    assert free_area(load_file(saved(drawing, tmp_path))) == pytest.approx(5.9 * 3.9, rel=0.01)


@pytest.mark.parametrize("release", ["R2000", "R2010"])
@pytest.mark.parametrize("is_damaged", [False, True])
def test_names_of_layers_are_read_in_the_encoding_of_the_release(tmp_path, release, is_damaged):
    document = ezdxf.new(release, units=4)
    document.layers.add("Wände")
    corners = [(0, 0), (6000, 0), (6000, 4000), (0, 4000)]
    document.modelspace().add_lwpolyline(corners, close=True, dxfattribs={"layer": "Wände"})
    document.modelspace().add_arc((2000, 2000), 500, 0, 180, {"layer": "Wände"})
    document.modelspace().add_line((0, 2000), (6000, 2000), {"layer": "furniture"})
    path = saved(document, tmp_path)
    if is_damaged:
        path.write_bytes(path.read_bytes().replace(b"AcDbArc", b"AcDbArk"))
    assert free_area(load_file(path, layers=("Wände",))) == pytest.approx(5.9 * 3.9, rel=0.02)


def test_meshes_are_left_out_and_told(drawing, tmp_path):
    drawing.modelspace().add_polyface().append_faces([[(1000, 1000), (2000, 1000), (2000, 2000)]])
    drawing.modelspace().add_polymesh((3, 3))
    floor = load_file(saved(drawing, tmp_path))
    assert free_area(floor) == pytest.approx(5.9 * 3.9, rel=0.01)
    assert floor.remark == "2 meshes are left out"


def test_a_drawing_without_a_unit_needs_a_resolution(drawing, tmp_path):
    drawing.header["$INSUNITS"] = 0
    path = saved(drawing, tmp_path)
    assert takes_resolution(path)
    with pytest.raises(ValueError, match=r"has no unit; want image_resolution \(--resolution"):
        load_file(path)
    assert load_file(path, 0.001).bounds == pytest.approx((-0.05, -0.05, 6.05, 4.05))
    drawing.header["$INSUNITS"] = 4
    assert load_file(saved(drawing, tmp_path), 0.01).bounds == pytest.approx((-0.05, -0.05, 60.05, 40.05))


def test_the_size_by_a_unit_that_is_hardly_meant_is_told(drawing, tmp_path, shared_cases):
    assert load_file(saved(drawing, tmp_path)).remark == ""
    drawing.header["$INSUNITS"] = 2
    with pytest.raises(ValueError, match=r"the drawing is 1,829 x 1,219 m; if that is wrong, give --resolution"):
        load_file(saved(drawing, tmp_path))
    hall = shared_cases / "dxf-unit-not-of-the-drawing" / "hall_mm.dxf"
    assert "the drawing is 254 x 203 m" in load_file(hall).remark
    described = describe_floor(load_file(hall, 0.001))
    assert described["size_m"] == pytest.approx([10.1, 8.1])
    assert described["area_m2"] == pytest.approx(77.5, abs=0.05)


def test_chosen_layers_alone_are_walls(drawing, tmp_path, shared_cases):
    for layer in ("WALLS", "DOORS"):
        drawing.layers.add(layer)
    drawing.layers.get("WALLS").freeze()
    block = drawing.blocks.new("door")
    block.add_line((0, 0), (0, 4000))
    drawing.modelspace().add_blockref("door", (2000, 0), {"layer": "DOORS"})
    corners = [(0, 0), (4000, 0), (4000, 4000), (0, 4000)]
    drawing.modelspace().add_lwpolyline(corners, close=True, dxfattribs={"layer": "WALLS"})
    path = saved(drawing, tmp_path)
    assert free_area(load_file(path, layers=["walls"])) == pytest.approx(3.9 * 3.9, rel=0.01)
    assert free_area(load_file(path, layers=["WALLS", "doors"])) == pytest.approx(3.8 * 3.9, rel=0.01)
    with pytest.raises(ValueError, match=r"has no lines on 'wall'; it has '0', .*'WALLS', 'DOORS'"):
        load_file(path, layers=["wall"])
    flat = shared_cases / "dxf-layers-and-doors" / "flat.dxf"
    for layers, area in ((["A-WALL"], 77.5), (["A-WALL", "A-FURN"], 75.3)):
        described = describe_floor(load_file(flat, layers=layers))
        assert described["size_m"] == pytest.approx([10.1, 8.1])
        assert (described["area_m2"], described["rooms"]) == (pytest.approx(area, abs=0.05), 2)
    described = describe_floor(load_file(flat))
    assert "m2 in 4 other areas cannot be reached" in described["remark"]
    assert described["reachable_m2"] < 0.5 * described["whole_m2"]


def test_what_is_no_plan_is_refused(tmp_path):
    with pytest.raises(ValueError, match=r"empty.dxf has no lines in model space"):
        load_file(saved(ezdxf.new(units=6), tmp_path, "empty.dxf"))
    (tmp_path / "text.dxf").write_text("no drawing\nEOF\n")
    with pytest.raises(ValueError, match=r"text.dxf is not a DXF drawing"):
        load_file(tmp_path / "text.dxf")


def test_a_file_that_is_cut_off_is_refused(drawing, tmp_path):
    content = saved(drawing, tmp_path).read_bytes()
    for share in (0.1, 0.5, 0.9):
        (tmp_path / "cut.dxf").write_bytes(content[: int(share * len(content))])
        with pytest.raises(ValueError, match=r"cut.dxf has no EOF at its end; want a whole DXF drawing"):
            load_file(tmp_path / "cut.dxf")


def test_dimensions_are_no_walls_and_multilines_are(drawing, tmp_path):
    space = drawing.modelspace()
    space.add_linear_dim((0, 2000), (0, 0), (6000, 0)).render()
    space.add_mline([(3000, 0), (3000, 3000)])
    floor = load_file(saved(drawing, tmp_path))
    # Two lines of a millimetre's distance, as a multiline's style has it.
    assert free_area(floor) == pytest.approx(5.9 * 3.9 - 0.1 * 2.95, rel=0.01)


def test_what_a_frozen_block_holds_is_left_out(drawing, tmp_path):
    drawing.layers.add("old").freeze()
    drawing.blocks.new("WALL").add_line((0, 0), (6000, 0))
    drawing.modelspace().add_blockref("WALL", (0, 2000), {"layer": "old"})
    assert free_area(load_file(saved(drawing, tmp_path))) == pytest.approx(5.9 * 3.9, rel=0.01)


def test_blocks_that_multiply_are_refused_before_they_are_drawn(drawing, tmp_path):
    for k in range(9):
        block = drawing.blocks.new(f"B{k}")
        for _ in range(9):
            block.add_blockref(f"B{k + 1}", (0, 0))
    drawing.blocks.new("B9")
    drawing.modelspace().add_blockref("B0", (0, 0))
    with pytest.raises(ValueError, match=r"plan.dxf has blocks of more than 4,000 entities; want a plan"):
        load_file(saved(drawing, tmp_path))


def test_rows_and_columns_of_a_block_are_counted(drawing, tmp_path):
    drawing.blocks.new("DESK").add_line((0, 0), (1, 0))
    insert = drawing.modelspace().add_blockref("DESK", (0, 0))
    insert.grid((30_000, 30_000), (1, 1))
    with pytest.raises(ValueError, match=r"plan.dxf has blocks of more than 4,000 entities; want a plan"):
        load_file(saved(drawing, tmp_path))


def test_a_large_curve_has_few_parts(drawing, tmp_path):
    drawing.modelspace().add_circle((3000, 2000), 90_000)
    floor = load_file(saved(drawing, tmp_path))
    assert len(floor.solids) < 1000
    assert floor.bounds == pytest.approx((-87.05, -88.05, 93.05, 92.05), abs=0.1)


def test_too_many_points_are_refused(drawing, tmp_path):
    for k in range(2000):
        drawing.modelspace().add_circle((k, k), 900_000)
    with pytest.raises(ValueError, match=r"has more than 25,000 straight walls, too many for its size"):
        load_file(saved(drawing, tmp_path))


ROOM = "0\nLWPOLYLINE\n90\n4\n70\n1\n10\n0\n20\n0\n10\n6\n20\n0\n10\n6\n20\n4\n10\n0\n20\n4\n"


def with_room(tmp_path, entities):
    """A drawing in metres of a room with four walls and of other entities."""
    sections = {"HEADER": "9\n$INSUNITS\n70\n6\n", "ENTITIES": ROOM + entities}
    path = tmp_path / "plan.dxf"
    path.write_text(
        "".join(f"0\nSECTION\n2\n{name}\n{text}0\nENDSEC\n" for name, text in sections.items()) + "0\nEOF\n"
    )
    return path


def zigzag(walls):
    """A polyline to and fro; a file of its size may have 25,000 walls."""
    return f"0\nLWPOLYLINE\n90\n{walls + 1}\n" + "".join(f"10\n{k % 2}\n20\n0\n" for k in range(walls + 1))


def arcs(count):
    """Arcs that are all the same; a file of their size may have 4,000 entities."""
    return "0\nARC\n8\n0\n10\n1\n20\n1\n40\n1\n50\n0\n51\n9\n" * count


@pytest.mark.parametrize(
    ("entities", "maximum", "told"),
    [(zigzag, 24_996, "more than 25,000 straight walls"), (arcs, 3_995, "more than 4,000 entities")],
)
def test_a_drawing_may_have_as_many_parts_as_are_allowed_and_not_one_more(tmp_path, entities, maximum, told):
    assert load_file(with_room(tmp_path, entities(maximum))).solids
    with pytest.raises(ValueError, match=told):
        load_file(with_room(tmp_path, entities(maximum + 1)))


def test_blocks_may_have_as_many_entities_as_are_allowed_and_not_one_more(drawing, tmp_path):
    for name, lines in (("DESK", 1_000), ("PEN", 1)):
        block = drawing.blocks.new(name)
        for _ in range(lines):
            block.add_line((0, 0), (1000, 0))
    for _ in range(4):
        drawing.modelspace().add_blockref("DESK", (1000, 1000))
    assert load_file(saved(drawing, tmp_path)).solids
    drawing.modelspace().add_blockref("PEN", (1000, 1000))
    with pytest.raises(ValueError, match="blocks of more than 4,000 entities"):
        load_file(saved(drawing, tmp_path))


def test_a_drawing_with_small_faults_is_repaired(drawing, tmp_path, caplog, capsys):
    path = saved(drawing, tmp_path)
    path.write_text(path.read_text().replace("6000.0", "6000.0abc", 1))
    assert load_file(path).bounds == pytest.approx((-0.05, -0.05, 6.05, 4.05))
    assert capsys.readouterr() == ("", "")


def test_a_block_that_is_not_there_is_refused(drawing, tmp_path):
    drawing.modelspace().add_blockref("NOWHERE", (0, 0))
    with pytest.raises(ValueError, match=r"plan.dxf is not a DXF drawing: .*NOWHERE"):
        load_file(saved(drawing, tmp_path))


@pytest.mark.parametrize("height", [0.0, 1e300])
def test_curves_that_are_too_far_away_are_refused(drawing, tmp_path, height):
    x = 3000 if height else 1e17
    drawing.modelspace().add_open_spline([(x, 0, height), (x, 100, -height), (x, 200, 0), (x, 900, 0)])
    with pytest.raises(ValueError, match=r"plan.dxf has a curve that reaches beyond 100,000,000 m"):
        load_file(saved(drawing, tmp_path))


@pytest.mark.parametrize(
    ("scale", "turn", "size"), [((1, 2), 90, (6, 20)), ((2, 2), 90, (12, 20)), ((-1, 2), 0, (10, 12))]
)
def test_a_turned_block_in_a_block_that_is_scaled_unevenly_is_scaled_after_its_turn(tmp_path, scale, turn, size):
    made = ezdxf.new("R2010", units=6)
    made.blocks.new("HALL").add_lwpolyline([(0, 0), (10, 0), (10, 6), (0, 6)], close=True)
    made.blocks.new("PART").add_blockref("HALL", (1, 2), {"rotation": turn})
    made.modelspace().add_blockref("PART", (20, 0), {"xscale": scale[0], "yscale": scale[1]})
    made.saveas(tmp_path / "plan.dxf")
    x_low, y_low, x_high, y_high = load_file(tmp_path / "plan.dxf").bounds
    assert (x_high - x_low, y_high - y_low) == pytest.approx(size, abs=0.15)


def test_invisible_entities_are_no_walls(tmp_path):
    made = ezdxf.new("R2010", units=6)
    made.modelspace().add_lwpolyline([(0, 0), (10, 0), (10, 6), (0, 6)], close=True)
    made.blocks.new("DOOR").add_line((0, 0), (0, 6), {"invisible": 1})
    made.modelspace().add_blockref("DOOR", (5, 0))
    made.modelspace().add_line((3, 0), (3, 6), {"invisible": 1})
    made.saveas(tmp_path / "plan.dxf")
    assert describe_floor(load_file(tmp_path / "plan.dxf"))["rooms"] == 1


def test_of_several_layers_none_may_be_missing(shared_cases):
    path = shared_cases / "dxf-layers-and-doors" / "flat.dxf"
    with pytest.raises(ValueError, match=r"has no layer 'a-furm'; want some of '0', .*'A-WALL'.*'A-FURN'"):
        load_file(path, layers=("A-WALL", "A-FURM"))
