"""Settings of matching."""

import pytest

from lidarium.mapping.localization.matching.settings.matching import MatchingSettings, SubmapSettings


def test_few_returns_count_less_than_many_but_not_more_than_all():
    matching = MatchingSettings()
    weights = [matching.weight(points) for points in (20, 40, 200, 10_000, 20_000)]
    assert weights[1] == pytest.approx(2 * weights[0])
    assert (
        weights[1]
        < weights[2]
        < weights[3]
        == weights[4]
        == pytest.approx(matching.independent_points / matching.deviation**2)
    )


@pytest.mark.parametrize(
    ("kind", "name", "value"),
    [
        (MatchingSettings, "distance_m", -1.0),
        (MatchingSettings, "points", 0),
        (SubmapSettings, "resolution", 0.0),
        (SubmapSettings, "least_scans", 0),
    ],
)
def test_settings_that_make_no_sense_are_refused(kind, name, value):
    with pytest.raises(ValueError, match=f"{name} of {kind.__name__} is"):
        kind(**{name: value})
