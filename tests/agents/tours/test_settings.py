"""How tours past frontiers are planned."""

import pytest

from lidarium.agents.tours.settings import TourSettings


def test_nothing_counts_that_lies_beyond_the_laser():
    settings = TourSettings(reach=3.0, around=0.8, depth=1.2)
    assert settings.rules(2.0).reach == 2.0
    assert settings.rules(9.0).reach == 3.0
    assert (settings.rules(9.0).around, settings.rules(9.0).depth) == (0.8, 1.2)


def test_the_longest_tour_counts_one_and_the_rest_is_weighed_against_it():
    assert tuple(TourSettings(total=0.3, waiting=0.2).weights) == (1.0, 0.3, 0.2)


@pytest.mark.parametrize(
    ("name", "value"), [("most", 0), ("kept_share", 1.5), ("reach", 0.0), ("kept", -1.0)]
)
def test_settings_that_make_no_sense_are_refused(name, value):
    with pytest.raises(ValueError, match=f"{name} of tours is"):
        TourSettings(**{name: value})
