"""Settings that both localizers on spline maps share."""

import pytest

from lidarium.mapping.localization.on_splines.tracking_settings import TrackingSettings


@pytest.mark.parametrize("wrong", [{"curve_sigma": 0.0}, {"ray_stride": 0}, {"slip_per_metre": -1.0}])
def test_settings_that_make_no_sense_are_refused(wrong):
    (name,) = wrong
    with pytest.raises(ValueError, match=f"{name} of tracking is .* want"):
        TrackingSettings(**wrong)
