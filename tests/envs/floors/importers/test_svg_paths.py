"""Outlines of shapes of SVG drawings go where their definitions say."""

import math
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest

from lidarium.envs.floors.importers.svg_paths import length, numbers, outlines, transform_of


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
    matrix = transform_of(ElementTree.fromstring(f'<g transform="{text}"/>'))
    assert np.allclose((matrix @ [*point, 1.0])[:2], wanted)


def test_numbers_need_no_space_between_them():
    assert numbers("1-2.5.5e1,+3") == [1.0, -2.5, 5.0, 3.0]
    assert length("12.5px") == 12.5
    assert length(None, 3.0) == length("none", 3.0) == 3.0


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
