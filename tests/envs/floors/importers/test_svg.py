"""Outlines of shapes of SVG drawings go where their definitions say."""

import math
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest

from lidarium.envs.floors.catalogue.names import describe_floor
from lidarium.envs.floors.importers import load_file, takes_resolution
from lidarium.envs.floors.importers.svg import _length, _numbers, _transform_of, outlines


def path(text):
    return outlines(ElementTree.fromstring(f'<path d="{text}"/>'), "path")


def test_curves_of_paths_go_where_their_definitions_say():
    (cubic,) = path("M0 0C0 1 2 3 4 4")
    share = np.arange(17)[:, None] / 16
    wanted = 3 * share * (1 - share) ** 2 * [0, 1] + 3 * share**2 * (1 - share) * [2, 3] + share**3 * [4, 4]
    assert np.allclose(cubic, wanted)
    (smooth,) = path("M0 0C0 1 2 3 4 4S8 4 8 0")
    (written_out,) = path("M0 0C0 1 2 3 4 4C6 5 8 4 8 0")
    assert np.allclose(smooth, written_out)
    (quadratic,) = path("m1 1q1 0 1 1t1 1")
    (again,) = path("M1 1Q2 1 2 2Q2 3 3 3")
    assert np.allclose(quadratic, again)


@pytest.mark.parametrize(("large", "sweep"), [(0, 0), (0, 1), (1, 0), (1, 1)])
def test_arcs_are_on_their_ellipse_and_the_wanted_part_of_it(large, sweep):
    (arc,) = path(f"M0 2A3 2 0 {large} {sweep} 3 4")
    # One of the two ellipses through both ends has its middle at 3, 2; the other at 0, 4.
    middle = np.array([3.0, 2.0]) if large == sweep else np.array([0.0, 4.0])
    assert np.allclose((((arc - middle) / [3.0, 2.0]) ** 2).sum(axis=1), 1.0)
    assert np.allclose(arc[-1], [3.0, 4.0])
    turns = np.unwrap(np.arctan2(*((arc - middle) / [3.0, 2.0]).T[::-1]))
    assert (abs(turns[-1] - turns[0]) > math.pi) == bool(large)
    assert (turns[-1] > turns[0]) == bool(sweep)


def test_an_arc_that_is_too_small_is_enlarged():
    (arc,) = path("M0 0A1 1 0 0 1 10 0")
    assert np.allclose(np.hypot(*(arc - [5.0, 0.0]).T), 5.0)


@pytest.mark.parametrize(
    ("text", "point", "wanted"),
    [
        ("rotate(90)", (1, 0), (0, 1)),
        ("rotate(90, 1, 1)", (1, 0), (2, 1)),
        ("translate(2) scale(3,4)", (1, 1), (5, 4)),
        ("matrix(1 2 3 4 5 6)", (1, 1), (9, 12)),
        ("skewX(45)", (0, 1), (1, 1)),
    ],
)
def test_transforms_move_points_as_defined(text, point, wanted):
    matrix = _transform_of(ElementTree.fromstring(f'<g transform="{text}"/>'))
    assert np.allclose((matrix @ [*point, 1.0])[:2], wanted)


def test_numbers_need_no_space_between_them():
    assert _numbers("1-2.5.5e1,+3") == [1.0, -2.5, 5.0, 3.0]
    assert _length("12.5px") == 12.5
    assert _length("1in") == pytest.approx(_length("25.4mm")) == pytest.approx(_length("72pt")) == 96.0
    assert _length("25 %", whole=8.0) == 2.0
    with pytest.raises(ValueError, match="a length is '3vw'; want one without a unit, or px"):
        _length("3vw")
    assert _length(None, 3.0) == _length("none", 3.0) == 3.0


def test_parts_of_a_path_begin_where_the_last_one_was_closed():
    first, second = path("m1 1h2v2z l5 0")
    assert first.tolist() == [[1, 1], [3, 1], [3, 3], [1, 1]]
    assert second.tolist() == [[1, 1], [6, 1]]


def test_shapes_without_extent_have_no_outline():
    for kind, attributes in (
        ("rect", 'width="0" height="3"'),
        ("circle", 'r="0"'),
        ("polygon", 'points="1 1"'),
        ("text", ""),
    ):
        assert outlines(ElementTree.fromstring(f"<{kind} {attributes}/>"), kind) == []


def test_a_command_with_too_few_numbers_is_refused():
    with pytest.raises(ValueError, match="a path has 'C' with 4 numbers; want 6"):
        path("M0 0C1 1 2 2")


ROOM = '<rect x="0" y="0" width="600" height="400" fill="none" stroke="black" stroke-width="10"/>'


def written(tmp_path, inside, head='xmlns="http://www.w3.org/2000/svg" viewBox="0 0 600 400"'):
    (tmp_path / "plan.svg").write_text(f"<svg {head}>{inside}</svg>")
    return tmp_path / "plan.svg"


def free_area(tmp_path, inside, resolution=0.01):
    """Return the free area of a plan [m2]."""
    floor = load_file(written(tmp_path, inside), resolution)
    return float((floor.raster(0.025, 0.2, 0.2).solid == 0).sum()) * 0.025**2


def test_a_room_is_as_large_as_it_is_drawn(tmp_path):
    floor = load_file(written(tmp_path, ROOM), 0.01)
    assert floor.name == "plan"
    assert floor.bounds == pytest.approx((0.05, -3.95, 5.95, -0.05), abs=0.026)
    assert free_area(tmp_path, ROOM) == pytest.approx(5.9 * 3.9, rel=0.01)


def test_a_thin_line_lets_nothing_through(tmp_path):
    wall = '<path d="M300 0V400" stroke="black" stroke-width="0.1" fill="none"/>'
    assert free_area(tmp_path, ROOM + wall) == pytest.approx(2.92 * 3.9, rel=0.02)


@pytest.mark.parametrize(
    ("shape", "area"),
    [
        ('<circle cx="300" cy="200" r="100"/>', math.pi),
        ('<ellipse cx="300" cy="200" rx="100" ry="50" style="fill:#222"/>', math.pi / 2),
        ('<polygon points="100,100 300,100 300,300" fill="rgb(10%, 20%, 10%)"/>', 2.0),
        ('<path d="M200 200a100,100 0 01200 0z"/>', math.pi / 2),
        ('<path d="M100 100h100v100h-100z m20 20v60h60v-60z" fill="navy"/>', 0.64 + 0.36),
        ('<rect x="100" y="100" width="100" height="100" fill="#eee"/>', 0.0),
        ('<rect x="100" y="100" width="100" height="100" fill="none"/>', 0.0),
        ('<rect x="100" y="100" width="100" height="100" display="none"/>', 0.0),
        ('<defs><rect x="100" y="100" width="100" height="100"/></defs><text>door</text>', 0.0),
        ('<g transform="translate(200 100) scale(2)" fill="black"><rect width="50" height="50"/></g>', 1.0),
        ('<g fill="white"><rect x="100" y="100" width="100" height="100" fill="inherit"/></g>', 0.0),
        (
            '<style>.a{fill:none} .b, .c{fill:#000}</style><rect class="a c" x="9" y="9" width="100" height="100"/>',
            1.0,
        ),
        (
            '<rect x="100" y="100" width="100" height="100"/><rect x="90" y="90" width="120" '
            'height="120" fill="white"/>',
            0.0,
        ),
    ],
)
def test_what_is_dark_is_solid(tmp_path, shape, area):
    # Where a ring encloses something, what it encloses is no part of the largest area.
    assert free_area(tmp_path, ROOM + shape) == pytest.approx(5.9 * 3.9 - area, abs=0.06)


BOX = '<rect x="100" y="100" width="100" height="100" {}/>'


@pytest.mark.parametrize(
    ("shape", "area"),
    [
        (BOX.format('opacity="0.4"'), 0.0),
        (BOX.format('opacity="80%"'), 1.0),
        (BOX.format('fill-opacity=".2"'), 0.0),
        (BOX.format('style="fill:#00000030"'), 0.0),
        (BOX.format('fill="rgba(0, 0, 0, 0.2)"'), 0.0),
        (BOX.format('fill="rgb(0 0 0 / 90%)"'), 1.0),
        (BOX.format('fill="hsl(0, 0%, 90%)"'), 0.0),
        (BOX.format('fill="currentColor" color="#eee"'), 0.0),
        (f'<g opacity="0.6"><g opacity="0.6">{BOX.format("")}</g></g>', 0.0),
        (BOX.format("") + BOX.format('fill="white" opacity="0.2"'), 1.0),
        (BOX.format("") + BOX.format('fill="white" opacity="0.9"'), 0.0),
        ('<linearGradient id="g"><stop stop-color="#fff"/></linearGradient>' + BOX.format('fill="url(#g)"'), 0.0),
        (
            '<linearGradient id="g"><stop stop-color="#222"/></linearGradient><radialGradient id="h" href="#g"/>'
            + BOX.format("fill=\"url('#h')\""),
            1.0,
        ),
        ('<pattern id="p"/>' + BOX.format('fill="url(#p)"'), 1.0),
        (BOX.format('fill="url(#none)"'), 0.0),
        ('<defs><rect id="r" width="100" height="100"/></defs><use href="#r" x="200" y="100"/>', 1.0),
        ('<g fill="white"><rect id="r" width="9" height="9"/></g><use href="#r" x="99"/>', 0.0081),
        (
            '<symbol id="s" viewBox="0 0 10 10"><rect width="10" height="10"/></symbol>'
            '<use href="#s" x="100" y="100" width="100" height="200"/>',
            1.0,
        ),
        ('<style>g.room > rect {fill: none}</style><g class="room">' + BOX.format("") + "</g>", 0.0),
        ('<style>.a .b {fill: none}</style><g class="a"><g>' + BOX.format('class="b"') + "</g></g>", 0.0),
        ('<style>.a > .b {fill: none}</style><g class="a"><g>' + BOX.format('class="b"') + "</g></g>", 1.0),
        ("<style>#x {fill: none} .b {fill: red} rect.b {fill: #eee}</style>" + BOX.format('class="b" id="x"'), 0.0),
        ("<style>rect.b {fill: #eee} .b {fill: red}</style>" + BOX.format('class="b"'), 0.0),
        ("<style>@media print { .b {fill: none} }</style>" + BOX.format('class="b"'), 1.0),
    ],
)
def test_what_is_seen_as_dark_is_solid(tmp_path, shape, area):
    assert free_area(tmp_path, ROOM + shape) == pytest.approx(5.9 * 3.9 - area, abs=0.06)


def test_what_is_left_out_of_a_drawing_is_told(tmp_path):
    left_out = '<style>rect:hover {fill: none} [a] {fill: none}</style><image href="a.png"/>'
    remark = load_file(written(tmp_path, ROOM + left_out), 0.01).remark
    assert remark == (
        "1 pictures in the drawing are left out; 2 rules of its style sheet are not understood and left out"
    )


@pytest.mark.parametrize(
    ("attribute", "name"),
    [
        ('clip-path="url(#a)"', "clip-path"),
        ('style="mask: url(#a); stroke-dasharray: none"', "mask"),
        ('style="transform: translate(500px)"', "transform in a style"),
        ('stroke-dasharray="2 2"', "stroke-dasharray"),
        ('systemLanguage="de"', "systemLanguage"),
    ],
)
def test_what_is_not_read_of_an_element_is_told(tmp_path, attribute, name):
    floor = load_file(written(tmp_path, f'{ROOM}<rect x="200" y="100" width="50" height="50" {attribute}/>'), 0.01)
    assert floor.remark == f"elements drawn without their {name}, which is not understood: 1"


def test_important_declarations_take_precedence(tmp_path):
    sheet = "<style>.light {fill: white !important} .dark {fill: black}</style>"
    for style, area in (("", 0.0), ("fill: black", 0.0), ("fill: black !important", 1.0)):
        block = f'<rect class="light dark" x="200" y="100" width="100" height="100" style="{style}"/>'
        assert free_area(tmp_path, sheet + ROOM + block) == pytest.approx(5.9 * 3.9 - area, abs=0.06)


def test_a_drawing_that_uses_itself_is_refused(tmp_path):
    with pytest.raises(ValueError, match="nested more than 64 deep"):
        load_file(written(tmp_path, ROOM + '<g id="a"><use href="#a"/></g>'), 0.01)
    doubled = "".join(f'<g id="g{k}"><use href="#g{k + 1}"/><use href="#g{k + 1}"/></g>' for k in range(30))
    with pytest.raises(ValueError, match="draws more than 250,000 elements"):
        load_file(written(tmp_path, f"{ROOM}<defs>{doubled}</defs><use href='#g0'/>"), 0.01)


def test_tints_close_no_rooms(shared_cases):
    paths = sorted((shared_cases / "svg-opacity").glob("*.svg"))
    assert len(paths) == 7
    for path in paths:
        described = describe_floor(load_file(path, 0.01))
        assert (described["area_m2"], described["rooms"]) == (pytest.approx(55.8, abs=0.15), 2), path.name


def test_a_drawing_needs_a_resolution(tmp_path):
    assert takes_resolution(written(tmp_path, ROOM))
    with pytest.raises(ValueError, match=r"does not say how large it is; want image_resolution \(--resolution"):
        load_file(tmp_path / "plan.svg")


@pytest.mark.parametrize(
    ("inside", "message"),
    [
        ("", r"no dark lines or areas"),
        ('<rect width="5" height="5" fill="white"/>', r"no dark lines or areas"),
        (ROOM + '<path d="M0 0C1 2"/>', r"a path has 'C' with 2 numbers; want 6"),
        ("<g>" * 80 + "</g>" * 80, r"nested more than 64 deep"),
        ("<g>", r"is not XML"),
        (ROOM + '<path d="M0 0L1e300 1e300" stroke="black"/>', r"plan.svg"),
    ],
)
def test_what_is_no_plan_is_refused(tmp_path, inside, message):
    with pytest.raises(ValueError, match=message):
        load_file(written(tmp_path, inside), 0.01)


def test_a_plan_that_is_too_large_says_what_to_do(tmp_path):
    with pytest.raises(ValueError, match=r"plan.svg"):
        load_file(written(tmp_path, ROOM), 100.0)
    (tmp_path / "other.svg").write_text("<html/>")
    with pytest.raises(ValueError, match=r"begins with 'html'; want an svg element"):
        load_file(tmp_path / "other.svg", 0.01)


def test_dark_shares_of_a_drawing_without_a_size_are_refused(tmp_path):
    (tmp_path / "a.svg").write_text("<svg><rect width='50%' height='9'/></svg>")
    with pytest.raises(ValueError, match=r"a.svg .*a share of the drawing, which has no viewBox"):
        load_file(tmp_path / "a.svg", 1.0)


def area(tmp_path, inside, root='viewBox="0 0 1000 600"'):
    """Return the reachable area of a drawing in centimetres [m2]."""
    (tmp_path / "plan.svg").write_text(f'<svg xmlns="http://www.w3.org/2000/svg" {root}>{inside}</svg>')
    return describe_floor(load_file(tmp_path / "plan.svg", 0.01))["reachable_m2"]


HALL = '<path fill-rule="evenodd" d="M0 0h1000v600h-1000z M20 20v560h960v-560z"/>'


def test_parts_of_a_path_that_overlap_are_one_wall_unless_the_rule_is_even_odd(tmp_path):
    """A partition in two parts that overlap by a metre: by the even-odd rule, it has a door there."""
    parts = "M490 0h20v350h-20z M490 250h20v350h-20z"
    assert area(tmp_path, f'{HALL}<path d="{parts}"/>') == pytest.approx(26.3, abs=0.3)
    assert area(tmp_path, f'{HALL}<path d="{parts}" style="fill-rule: evenodd"/>') == pytest.approx(52.8, abs=0.5)
    # Parts that run against each other are holes by either rule.
    hole = "M200 200h400v200h-400z M300 250v100h200v-100z"
    assert area(tmp_path, f'{HALL}<path d="{hole}"/>') == pytest.approx(9.6 * 5.6 - 8.0, abs=0.5)


@pytest.mark.parametrize("width", [10, 30, 50])
@pytest.mark.parametrize(("cap", "longer"), [("butt", 0.0), ("square", 1.0)])
def test_a_door_between_ends_of_lines_is_as_wide_as_it_is_drawn(tmp_path, width, cap, longer):
    lines = f'<path d="M500 0v255 M500 345v255" stroke="black" stroke-width="{width}" stroke-linecap="{cap}"/>'
    (tmp_path / "plan.svg").write_text(f'<svg viewBox="0 0 1000 600">{HALL}{lines}</svg>')
    raster = load_file(tmp_path / "plan.svg", 0.01).raster(0.025, 0.3, 0.3)
    column = raster.solid[:, math.floor((5.0 - raster.origin[0]) / 0.025)]
    inside = column[math.floor((-5.7 - raster.origin[1]) / 0.025) : math.floor((-0.3 - raster.origin[1]) / 0.025)]
    assert 0.025 * (inside == 0).sum() == pytest.approx(0.9 - longer * width / 100, abs=0.03)


SMALL = '<path fill-rule="evenodd" d="M0 0h100v60h-100z M2 2v56h96v-56z"/>'


@pytest.mark.parametrize(
    "inside",
    [
        f'<svg viewBox="0 0 100 60">{SMALL}</svg>',
        f'<svg viewBox="0 0 100 60" width="100%" height="100%">{SMALL}</svg>',
        f'<symbol id="a" viewBox="0 0 100 60">{SMALL}</symbol><use href="#a"/>',
        '<svg viewBox="0 0 100 100" preserveAspectRatio="none">'
        '<path fill-rule="evenodd" d="M0 0h100v100h-100z M2 3.333v93.333h96v-93.333z"/></svg>',
    ],
)
def test_a_drawing_within_a_drawing_fills_it_by_default(tmp_path, inside):
    assert area(tmp_path, inside) == pytest.approx(9.6 * 5.6, abs=0.5)


@pytest.mark.parametrize(("align", "left"), [("xMinYMid", 0.0), ("xMidYMid", 2.0), ("xMaxYMax", 4.0)])
def test_a_drawing_within_a_drawing_is_aligned_as_it_says(tmp_path, align, left):
    square = '<path fill-rule="evenodd" d="M0 0h100v100h-100z M2 2v96h96v-96z"/>'
    inside = f'<svg viewBox="0 0 100 100" preserveAspectRatio="{align}">{square}</svg>'
    (tmp_path / "plan.svg").write_text(f'<svg viewBox="0 0 1000 600">{inside}</svg>')
    floor = load_file(tmp_path / "plan.svg", 0.01)
    assert floor.bounds[0] == pytest.approx(left + 0.12, abs=0.05)
    assert floor.bounds[2] == pytest.approx(left + 5.88, abs=0.05)
