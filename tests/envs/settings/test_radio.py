"""How robots reach each other."""

import math

import pytest

from lidarium.envs.settings.radio import RADIO, RADIO_KINDS, RadioSettings


def test_a_radio_is_ideal_where_all_arrives_at_once():
    assert RadioSettings().is_ideal
    for change in ({"kind": "range"}, {"loss": 0.1}, {"latency_s": 0.1}):
        assert not RadioSettings(**change).is_ideal


def test_each_kind_has_a_radio_of_its_name():
    assert [(name, radio.kind) for name, radio in RADIO.items()] == [(kind, kind) for kind in RADIO_KINDS]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"kind": "smoke"}, "kind of the radio is 'smoke'; want one of all, none"),
        ({"loss": 1.0}, "loss of the radio is 1"),
        ({"reach": 0.0}, "reach of the radio is 0"),
        ({"period_s": math.inf}, "period_s of the radio is inf"),
    ],
)
def test_what_no_radio_does_is_refused(change, message):
    with pytest.raises(ValueError, match=message):
        RadioSettings(**change)
