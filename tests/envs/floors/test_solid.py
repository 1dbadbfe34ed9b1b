"""Prisms that stand on a floor, also thin ones."""

import math

import numpy as np
import pytest

from lidarium.envs.floors.solid import Solid, middle_line, width_of

SQUARE = np.array([(0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0)])


def strip_along(length, thickness, angle):
    corners = np.array([(0.0, 0.0), (length, 0.0), (length, thickness), (0.0, thickness)])
    cosine, sine = math.cos(angle), math.sin(angle)
    return corners @ np.array([[cosine, sine], [-sine, cosine]]) + (100.0, -50.0)


def test_a_solid_cuts_what_its_heights_overlap_with():
    table = Solid(SQUARE, 0.7, 0.75)
    assert table.cuts(0.0, 2.0)
    assert not table.cuts(0.0, 0.7)
    assert not table.cuts(0.75, 2.0)
    assert table.cuts(0.7, 0.7)
    assert not table.cuts(0.75, 0.75)


def test_edges_are_those_of_polygon_and_holes():
    solid = Solid(SQUARE, holes=(SQUARE / 4 + 0.5,))
    assert solid.edges.shape == (8, 4)
    lengths = np.hypot(*(solid.edges[:, 2:] - solid.edges[:, :2]).T)
    assert lengths.sum() == pytest.approx(8.0 + 2.0)


@pytest.mark.parametrize("angle", [0.0, 0.4, 2.0])
def test_a_strip_is_as_wide_as_it_is_thick_and_its_middle_line_runs_along_it(angle):
    strip = strip_along(3.0, 0.1, angle)
    assert width_of(strip) == pytest.approx(0.1, rel=1e-3)
    (line,) = middle_line(strip)
    assert np.hypot(*(line[2:] - line[:2])) == pytest.approx(3.0)
    assert (line[:2] + line[2:]) / 2 == pytest.approx(strip.mean(axis=0))


def test_a_bent_strip_is_as_wide_as_the_strip():
    bent = np.array([(0, 0), (3, 0), (3, 3), (2.9, 3), (2.9, 0.1), (0, 0.1)], np.float64)
    assert width_of(bent) == pytest.approx(2 * 0.59 / 12.0, rel=1e-6)
    assert len(middle_line(bent)) == 6


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"z_low": 1.0, "z_high": 1.0}, "has no height; want z_low < z_high"),
        ({"polygon": SQUARE[:2]}, "polygon has shape"),
        ({"polygon": SQUARE * np.nan}, "not finite"),
        ({"holes": (SQUARE[:, :1],)}, "hole has shape"),
    ],
)
def test_what_is_no_prism_is_refused(given, message):
    with pytest.raises(ValueError, match=message):
        Solid(**{"polygon": SQUARE, **given})
