"""Correlation of two maps at all translations at once."""

import math

import numpy as np
import pytest
from drawn_maps import RESOLUTION, about_middle, apartment, blank, moved

from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.merging.correlation import CorrelationSettings, best_translations
from lidarium.mapping.merging.described_map import describe_map

SETTINGS = CorrelationSettings()


@pytest.mark.parametrize("theta", [0.0, 0.7, -2.0])
@pytest.mark.parametrize("shift", [(0.0, 0.0), (-3.0, 2.0)])
def test_the_best_translation_is_the_true_one_to_a_coarse_cell(theta, shift):
    truth = about_middle(theta, apartment(), shift=shift)
    a, b = (describe_map(levels, RESOLUTION) for levels in (moved(apartment(), truth), apartment()))
    transforms, values = best_translations(a, b, np.array([theta]), SETTINGS)
    assert transforms.shape == (SETTINGS.peaks, 3)
    best = Transform(*transforms[int(values.argmax())].tolist())
    assert best.difference(truth, (5.0, 4.0))[0] < 1.5 * SETTINGS.cell_m


def test_walls_speak_most_at_the_true_rotation():
    truth = about_middle(0.5, apartment())
    a, b = (describe_map(levels, RESOLUTION) for levels in (moved(apartment(), truth), apartment()))
    angles = 0.5 + np.arange(8) * math.pi / 4.0
    transforms, values = best_translations(a, b, angles, SETTINGS)
    np.testing.assert_allclose(transforms[:, 2], np.repeat(angles, SETTINGS.peaks))
    assert transforms[int(values.argmax()), 2] == pytest.approx(0.5)
    # No wall counts twice: what agrees is at most the length of the walls that there are.
    assert 0.3 * len(b.walls) * RESOLUTION < values.max() < 1.5 * len(b.walls) * RESOLUTION


def test_a_map_may_lie_beyond_the_lower_left_corner_of_the_other():
    a, b = describe_map(apartment()[60:, 70:].copy(), RESOLUTION), describe_map(apartment(), RESOLUTION)
    transforms, values = best_translations(a, b, np.zeros(1), SETTINGS)
    np.testing.assert_allclose(transforms[int(values.argmax()), :2], (-3.5, -3.0), atol=0.15)


def test_translations_of_one_rotation_lie_apart():
    one = describe_map(apartment(), RESOLUTION)
    transforms, values = best_translations(one, one, np.zeros(1), CorrelationSettings(peaks=6), 2.0)
    assert (np.diff(values) <= 0.0).all()
    for i in range(6):
        for j in range(i):
            assert np.abs(transforms[i, :2] - transforms[j, :2]).max() >= 2.0


def test_maps_without_walls_and_no_rotations_have_no_translations():
    one, none = describe_map(apartment(), RESOLUTION), describe_map(blank(), RESOLUTION)
    for a, b, rotations in ((none, one, np.zeros(1)), (one, none, np.zeros(1)), (one, one, np.zeros(0))):
        transforms, values = best_translations(a, b, rotations, SETTINGS)
        assert (transforms.shape, values.shape) == ((0, 3), (0,))


def test_large_maps_are_made_coarser_and_still_found():
    one = describe_map(apartment(), RESOLUTION)
    transforms, values = best_translations(one, one, np.zeros(1), CorrelationSettings(most_cells=40))
    cell = apartment().shape[1] * RESOLUTION / 40
    np.testing.assert_allclose(transforms[int(values.argmax())], (0.0, 0.0, 0.0), atol=1.01 * cell)


def test_settings_out_of_range_are_named():
    with pytest.raises(ValueError, match="peaks"):
        CorrelationSettings(peaks=0)
