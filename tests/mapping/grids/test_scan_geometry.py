"""Directions and reach of the beams of a scan."""

import math

import numpy as np
import pytest

from lidarium.mapping.grids.scan_geometry import ScanGeometry, beam_directions, beams_towards, fast_angle


def test_beams_are_symmetric_about_the_heading_from_right_to_left():
    angles = ScanGeometry(beams=5, field_of_view=math.pi).angles
    np.testing.assert_allclose(angles, np.array([-0.5, -0.25, 0.0, 0.25, 0.5]) * math.pi)


def test_the_last_beam_of_a_full_circle_does_not_repeat_the_first():
    geometry = ScanGeometry(beams=4, field_of_view=2.0 * math.pi)
    assert geometry.is_full_circle
    np.testing.assert_allclose(geometry.angles, np.array([-1.0, -0.5, 0.0, 0.5]) * math.pi)
    assert not ScanGeometry(beams=4, field_of_view=6.28).is_full_circle


def test_one_beam_looks_ahead():
    geometry = ScanGeometry(beams=1)
    assert geometry.angles.tolist() == [0.0]
    np.testing.assert_allclose(geometry.unit_vectors, [[1.0], [0.0]])


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"beams": 0}, "beams of the scan"),
        ({"beams": 16_385}, "beams of the scan"),
        ({"field_of_view": 7.0}, "field_of_view"),
        ({"range_min": 6.0}, "range_min is 6.0 m and range_max is 5.6 m"),
    ],
)
def test_lasers_that_cannot_be_are_refused(wrong, message):
    with pytest.raises(ValueError, match=message):
        ScanGeometry(**wrong)


@pytest.mark.parametrize("heading", [0.0, 0.7, -2.5])
def test_directions_are_turned_by_the_heading_and_have_inverses(heading):
    geometry = ScanGeometry(beams=9, field_of_view=math.pi)
    found = np.empty((4, 9))
    beam_directions(heading, geometry.unit_vectors, found)
    angles = geometry.angles + heading
    np.testing.assert_allclose(found[:2], [np.cos(angles), np.sin(angles)], atol=1e-12)
    is_slanting = found[:2] != 0.0
    np.testing.assert_allclose(found[2:][is_slanting], 1.0 / found[:2][is_slanting])
    assert (found[2:][~is_slanting] == np.inf).all()


def test_a_beam_along_an_axis_has_an_infinite_inverse():
    found = np.empty((4, 1))
    beam_directions(0.0, np.array([[1.0], [0.0]]), found)
    assert found[:, 0].tolist() == [1.0, 0.0, 1.0, math.inf]


def test_fast_angles_are_right_to_some_hundred_thousandths():
    for angle in np.linspace(-math.pi + 1e-6, math.pi, 721).tolist():
        for length in (1e-3, 1.0, 500.0):
            found = fast_angle(length * math.sin(angle), length * math.cos(angle))
            assert abs(math.remainder(found - angle, math.tau)) < 2e-5


@pytest.mark.parametrize("heading", [0.0, 2.0, -3.0])
def test_every_beam_that_meets_a_disc_is_in_the_range_of_beams(heading):
    geometry = ScanGeometry(beams=360, field_of_view=2.0 * math.pi)
    generator = np.random.default_rng(1)
    for x, y, radius in generator.uniform([-4, -4, 0.05], [4, 4, 1.0], (60, 3)).tolist():
        begin, count = beams_towards(x, y, radius, heading, geometry.angle_first, geometry.angle_increment)
        turned = geometry.angles + heading
        aside = np.abs(np.cos(turned) * y - np.sin(turned) * x)
        is_met = (aside <= radius) & (np.cos(turned) * x + np.sin(turned) * y > 0.0) | (math.hypot(x, y) <= radius)
        offset = (np.arange(360) - begin) % 360.0
        assert ((offset <= count + 0.02) | (offset >= 359.98))[is_met].all()
        assert count <= is_met.sum() + 1.1 or math.hypot(x, y) <= radius
