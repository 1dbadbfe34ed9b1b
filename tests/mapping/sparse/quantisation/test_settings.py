"""Settings of quantisation."""

import pytest

from lidarium.mapping.sparse.quantisation.settings import QuantisationSettings


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"method": "median"}, r"method of quantisation is 'median'; want one of kmeans\+\+, kmeans, lbg"),
        ({"mode": "printed"}, "want one of default, thesis"),
        ({"device": "tpu"}, "want one of cpu"),
        ({"budget_s": 0.0}, "budget_s of quantisation"),
        ({"steps": -1}, "steps of quantisation"),
    ],
)
def test_settings_that_make_no_sense_are_refused(wrong, message):
    with pytest.raises(ValueError, match=message):
        QuantisationSettings(**wrong)


def test_codes_without_points_stay_in_the_thesis_mode_alone():
    assert QuantisationSettings(mode="thesis").keeps_empty
    assert not QuantisationSettings().keeps_empty
