"""Settings of the tree are checked by name."""

import math

import pytest

from lidarium.agents.srt.settings import SrtSettings, make_srt_settings


@pytest.mark.parametrize(
    ("setting", "value"),
    [
        ("shape", "cube"),
        ("candidates", "best"),
        ("nodes", 0),
        ("step_share", 1.0),
        ("margin", math.nan),
        ("random_share", 2.0),
        ("least_step", 0.0),
        ("turning_starts", 0.1),
    ],
)
def test_bad_settings_are_refused_by_name(setting, value):
    with pytest.raises(ValueError, match=setting):
        SrtSettings(**{setting: value})


def test_modes_and_unknown_settings():
    assert make_srt_settings("thesis").shape == "star"
    assert make_srt_settings("thesis", shape="ball").shape == "ball"
    with pytest.raises(ValueError, match="mode of the tree is 'printed'"):
        make_srt_settings("printed")
    with pytest.raises(ValueError, match="unknown setting 'colour'"):
        make_srt_settings(colour="red")
