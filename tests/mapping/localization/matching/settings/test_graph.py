"""Settings of closures, of the graph and of the compass check themselves."""

import math

import pytest

from lidarium.mapping.localization.matching.settings.graph import (
    ClosureSettings,
    CompassSettings,
    GraphSettings,
)


@pytest.mark.parametrize(
    ("kind", "name", "value"),
    [
        (ClosureSettings, "delay_s", math.nan),
        (ClosureSettings, "search_m", 0.0),
        (GraphSettings, "distance_m", 0.0),
        (GraphSettings, "waiting", 0),
        (CompassSettings, "drift", -1.0),
    ],
)
def test_settings_that_make_no_sense_are_refused(kind, name, value):
    with pytest.raises(ValueError, match=f"{name} of {kind.__name__} is"):
        kind(**{name: value})
