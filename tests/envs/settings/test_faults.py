"""What goes wrong with a team, at set times or at a rate."""

import math

import pytest

from lidarium.envs.settings.faults import KINDS, MOST_DRAWN, NO_FAULTS, Fault, FaultSettings
from lidarium.envs.settings.making import make_settings


def test_faults_of_files_are_mappings():
    made = FaultSettings(schedule=[{"kind": "kidnapping", "robot": 1, "place": [1, 2, 3]}])
    assert made.schedule == (Fault(kind="kidnapping", robot=1, place=(1.0, 2.0, 3.0)),)
    assert hash(made) == hash(FaultSettings(schedule=made.schedule))


def test_the_capacity_is_that_of_the_robot_with_most_faults():
    schedule = [Fault(kind="dead_radio", robot=robot, at_s=float(k)) for k, robot in enumerate((0, 1, 1, 2, 1))]
    assert NO_FAULTS.capacity == 0
    assert FaultSettings(schedule=schedule).capacity == 3
    assert FaultSettings(schedule=schedule, stuck_wheel=0.1).capacity == 3 + MOST_DRAWN


def test_rates_are_in_the_order_of_the_kinds():
    made = FaultSettings(**{kind: float(k) for k, kind in enumerate(KINDS[1:])})
    assert made.rates == (0.0, 1.0, 2.0, 3.0, 4.0, 5.0)


@pytest.mark.parametrize(
    ("fault", "message"),
    [
        ({"kind": "flood"}, "kind of the fault is 'flood'; want one of laser_dropout"),
        ({"kind": ""}, "kind of the fault is ''"),
        ({"kind": "blind_sector", "width": 0.0}, r"0\.0 rad wide"),
        ({"kind": "stuck_wheel", "wheel": "third"}, "wheel of the fault is 'third'"),
        ({"kind": "kidnapping", "place": (1.0, 2.0)}, "place of the fault is"),
        ({"kind": "kidnapping", "place": (1.0, 2.0, math.nan)}, "place of the fault is"),
        ({"kind": "dead_robot", "robot": 64}, "robot of the fault is 64"),
        ({"kind": "dead_robot", "at": 3.0}, "one that cannot be used"),
    ],
)
def test_a_fault_that_there_is_not_is_refused(fault, message):
    with pytest.raises(ValueError, match=message):
        FaultSettings(schedule=[fault])


@pytest.mark.parametrize("schedule", ["dead_robot", 3, [3]])
def test_a_schedule_is_a_list_of_faults(schedule):
    with pytest.raises(ValueError, match="schedule of faults is"):
        FaultSettings(schedule=schedule)


def test_a_fault_of_a_robot_that_the_team_lacks_is_refused():
    schedule = [Fault(kind="dead_radio"), Fault(kind="dead_robot", robot=1)]
    make_settings(robots=2, faults=FaultSettings(schedule=schedule))
    with pytest.raises(ValueError, match=r"fault 1 \(dead_robot\) is of robot 1, but robots is 1; want a robot"):
        make_settings(robots=1, faults=FaultSettings(schedule=schedule))
