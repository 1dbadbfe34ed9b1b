"""Entries of the supervisor's log are what JSON can hold."""

import json
import math

from lidarium.agents.supervisor.log import Decision, StationEvent
from lidarium.agents.supervisor.tree import RobotInputs
from lidarium.envs.onboard.radio.messages import OperatingState


def inputs(agent, remaining_m):
    return RobotInputs(agent, remaining_m, OperatingState.OPERATING, 0.333333, 4.0)


def decision(**changes):
    values = {
        "time_s": 1.23456789,
        "agent": "a",
        "group": ("a", "b"),
        "inputs": inputs("a", math.inf),
        "rival": inputs("b", 2.000049),
        "answers": (("is it free?", True), ("is it near?", False)),
        "rule": 3,
        "order": "drive",
        "why": "because",
        "place": (0.123456, 1.0),
        "goal": (2.0, 3.00004),
    }
    return Decision(**{**values, **changes})


def test_a_decision_has_its_causes_in_short_numbers():
    found = decision().as_dict()
    assert found["event"] == "decision"
    assert found["time_s"] == 1.234568
    assert found["answers"] == {"is it free?": True, "is it near?": False}
    assert (found["place"], found["goal"]) == ([0.1235, 1.0], [2.0, 3.0])
    assert found["rival"]["remaining_m"] == 2.0
    assert found["inputs"]["map_known"] == 0.3333
    assert json.loads(json.dumps(found, allow_nan=False)) == found


def test_what_is_endless_or_absent_is_null():
    found = decision(rival=None, goal=None, order=None).as_dict()
    assert found["inputs"]["remaining_m"] is None
    assert found["rival"] is found["goal"] is found["order"] is None
    assert found["inputs"]["state"] == OperatingState.OPERATING.value


def test_an_event_is_named_with_its_time_and_agents():
    event = StationEvent(1.23456789, "joined", ("a", "b"), "by corners")
    assert event.as_dict() == {
        "event": "joined",
        "time_s": 1.234568,
        "agents": ["a", "b"],
        "words": "by corners",
    }
