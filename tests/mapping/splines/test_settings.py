"""Settings of curves are checked."""

import pytest

from lidarium.mapping.splines.settings import PointSettings, SegmentationSettings, SplineSettings


@pytest.mark.parametrize(
    "make",
    [
        lambda: SegmentationSettings(test="none"),
        lambda: SegmentationSettings(least_points=3),
        lambda: SegmentationSettings(incidence=2.0),
        lambda: PointSettings(noise_floor=0.0),
        lambda: SegmentationSettings(corner_rule="bend"),
    ],
)
def test_settings_that_make_no_sense_are_refused(make):
    with pytest.raises(ValueError, match="want"):
        make()


def test_settings_are_whole_by_default():
    assert SplineSettings().segmentation == SegmentationSettings()
