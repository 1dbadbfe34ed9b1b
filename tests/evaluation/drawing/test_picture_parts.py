"""Parts of pictures."""

import numpy as np
import pytest
from matplotlib import rcParams
from matplotlib.figure import Figure

from lidarium.evaluation.drawing.picture_parts import (
    box_around,
    draw_curve,
    draw_trajectories,
    drawn_together,
    hex_colours,
    list_robots,
    page,
    plain_words,
    rgb,
    save_figure,
)


def test_a_box_is_around_what_is_seen_with_a_margin_and_stays_on_the_raster():
    seen = np.zeros((100, 200), bool)
    seen[40:50, 0:60] = True
    box = box_around(seen, (1.0, -2.0), 0.05)
    assert (box.rows, box.columns) == (slice(37, 53), slice(0, 63))
    assert box.extent == pytest.approx((1.0, 1.0 + 63 * 0.05, -2.0 + 37 * 0.05, -2.0 + 53 * 0.05))
    assert box.aspect == pytest.approx(63 / 16)


def test_of_cells_that_are_drawn_as_one_the_highest_class_shows():
    few = np.arange(6, dtype=np.uint8).reshape(2, 3)
    assert drawn_together(few) is few
    many = np.zeros((3001, 5), np.uint8)
    many[2, 3], many[2, 2], many[3000, 4] = 2, 1, 1
    found = drawn_together(many)
    assert found.shape == (1501, 3)
    assert np.argwhere(found).tolist() == [[1, 1], [1500, 2]]
    assert found[1, 1] == 2


def test_colours_are_what_their_names_say():
    assert rgb("#1f2937").tolist() == [31, 41, 55]
    names = hex_colours(5)
    assert len(set(names)) == 5
    assert ["#{:02x}{:02x}{:02x}".format(*rgb(name)) for name in names] == names


def test_the_curve_goes_on_to_the_end_of_the_episode():
    axes = Figure().subplots()
    draw_curve(axes, [(0.0, 0.1), (4.0, 0.6)], {0.5: 4.0}, 20.0)
    line, marks = axes.lines
    assert list(line.get_xdata()) == [0.0, 4.0, 20.0]
    assert list(line.get_ydata()) == pytest.approx([10.0, 60.0, 60.0])
    assert (list(marks.get_xdata()), list(marks.get_ydata())) == ([4.0], [50.0])
    assert axes.texts[0].get_text() == "50 % at 4.0 s"


@pytest.mark.parametrize("count", [2, 16, 18])
def test_of_a_large_team_some_are_listed_and_the_others_counted(count):
    axes = Figure().subplots()
    list_robots(axes, ["path"], [["no_frontier", f"{robot} m"] for robot in range(count)], ["below"])
    words = [text.get_text() for text in axes.texts]
    assert sum(word.endswith("no frontier") for word in words) == min(count, 16)
    assert ("and 2 more" in words) == (count == 18)
    assert words[-1] == "below"


def test_paths_run_from_the_start_to_where_the_robot_is():
    axes = Figure().subplots()
    axes.set_xlim(0.0, 10.0)
    track = np.array([[(1.0, 1.0, 0.0), (5.0, 5.0, 0.0)], [(2.0, 1.0, 1.0), (5.0, 6.0, 3.0)]])
    draw_trajectories(axes, track, 0.3)
    assert list(axes.lines[1].get_ydata()) == [5.0, 6.0]
    assert [tuple(patch.center) for patch in axes.patches] == [(2.0, 1.0), (5.0, 6.0)]
    assert [(text.get_text(), text.get_position()) for text in axes.texts] == [
        ("0", (1.0, 1.0)),
        ("1", (5.0, 5.0)),
    ]


def test_a_wide_floor_has_its_figures_below():
    for aspect, is_below in ((1.0, False), (4.0, True)):
        figure, floor, curve, team = page(aspect)
        figure.draw_without_rendering()
        assert (curve.get_position().y1 <= floor.get_position().y0) == is_below
        assert len(figure.axes) == len({floor, curve, team}) == 3


def test_a_picture_that_cannot_be_written_leaves_nothing(tmp_path):
    (tmp_path / "a.png").mkdir()
    with pytest.raises(OSError, match=r"a\.png"):
        save_figure(tmp_path / "a.png", Figure())
    assert [path.name for path in tmp_path.iterdir()] == ["a.png"]


def test_a_dollar_begins_no_formula_and_what_controls_a_terminal_is_replaced():
    figure = Figure()
    axes = figure.subplots()
    axes.set_title("$\\frac{$\x1b[31m\nsecond")
    with plain_words(figure):
        assert not axes.title.get_parse_math()
        assert axes.title.get_text() == "$\\frac{$\N{REPLACEMENT CHARACTER}[31m\nsecond"
        assert not rcParams["text.parse_math"]
    assert rcParams["text.parse_math"]
