"""What the drives of robots are at."""

import numpy as np
import pytest

from lidarium.envs.onboard.driving.drives import (
    DRIVE_STATES,
    any_newly_done,
    drive_state,
    drive_states,
    drop_path,
    is_done,
    mark_waiting,
    no_drives,
)
from lidarium.envs.onboard.driving.path_following import ARRIVED, BLOCKED, DRIVING, IDLE
from lidarium.envs.onboard.radio.messages import DriveState


def drive(**given):
    """Return the drive of one robot with a target and a path."""
    drives = no_drives(1)
    drives.is_ordered[0] = drives.has_path[0] = True
    for name, value in given.items():
        getattr(drives, name)[0] = value
    return drives


@pytest.mark.parametrize(
    ("given", "wanted"),
    [
        ({"states": DRIVING}, DriveState.DRIVING),
        ({"states": ARRIVED}, DriveState.ARRIVED),
        ({"states": BLOCKED}, DriveState.BLOCKED),
        ({"states": IDLE}, DriveState.IDLE),
        ({"has_path": False}, DriveState.NO_PATH),
        ({"has_path": False, "is_ordered": False}, DriveState.IDLE),
        ({"passing": 0, "states": DRIVING}, DriveState.GIVING_WAY),
    ],
)
def test_states_have_their_names(given, wanted):
    drives = drive(**given)
    assert DRIVE_STATES[drive_state(drives, 0)] is wanted
    assert drive_states(drives).tolist() == [DRIVE_STATES.index(wanted)]


@pytest.mark.parametrize(
    ("given", "is_waiting"),
    [
        ({"states": ARRIVED}, True),
        ({"states": IDLE, "has_path": False}, True),
        ({"states": DRIVING}, False),
        ({"states": BLOCKED}, False),
        ({"states": ARRIVED, "passing": 0}, False),
        ({"states": ARRIVED, "is_ordered": False}, False),
    ],
)
def test_who_is_at_rest_with_a_target_waits_for_the_next(given, is_waiting):
    assert is_done(drive(**given), 0) == is_waiting


def test_only_live_robots_that_did_not_wait_before_are_newly_done():
    drives, waiting, live = no_drives(4), np.zeros(4, np.bool_), np.ones(4, np.bool_)
    drives.is_ordered[:], drives.states[:] = True, DRIVING
    drives.states[1] = ARRIVED
    mark_waiting(drives, 0, 4, waiting)
    assert waiting.tolist() == [False, True, False, False]
    assert not any_newly_done(drives, 0, 4, live, waiting)
    drives.states[2] = ARRIVED
    assert any_newly_done(drives, 0, 4, live, waiting)
    assert not any_newly_done(drives, 0, 2, live, waiting)
    live[2] = False
    assert not any_newly_done(drives, 0, 4, live, waiting)


def test_a_path_that_is_dropped_leaves_the_target():
    drives = drive(states=BLOCKED, stood=5, counts=7)
    drop_path(drives, 0)
    assert (drives.states[0], drives.stood[0], drives.counts[0], drives.has_path[0]) == (IDLE, 0, 0, False)
    assert DRIVE_STATES[drive_state(drives, 0)] is DriveState.NO_PATH
