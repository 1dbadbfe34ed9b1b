"""A team as the policy under a supervisor sees it."""

from types import SimpleNamespace

import pytest

from lidarium.agents.supervisor.led_team import LedTeam
from lidarium.envs.onboard.radio.messages import DriveState


def led(exploring):
    asked = []

    def answered(name):
        def answer(*given):
            asked.append((name, *given))
            return f"{name} of {given[0]}"

        return answer

    names = ("belief", "operating_state", "report", "last_order", "send_map", "forget_walls")
    team = SimpleNamespace(
        agents=["a", "b"],
        time_s=4.0,
        drive_state=lambda agent: DriveState.BLOCKED,
        **{name: answered(name) for name in names},
    )
    return LedTeam(team, exploring), asked


def test_drives_for_the_supervisor_are_hidden():
    exploring = {"a"}
    team, _ = led(exploring)
    assert (team.drive_state("a"), team.drive_state("b")) == (DriveState.BLOCKED, DriveState.IDLE)
    # The supervisor may take a robot, or give it back, at any time.
    exploring.add("b")
    exploring.discard("a")
    assert (team.drive_state("a"), team.drive_state("b")) == (DriveState.IDLE, DriveState.BLOCKED)


@pytest.mark.parametrize("name", ["belief", "operating_state", "report", "last_order"])
def test_all_else_is_what_the_team_says(name):
    team, asked = led(set())
    assert getattr(team, name)("b") == f"{name} of b"
    assert asked == [(name, "b")]
    assert (team.agents, team.time_s) == (["a", "b"], 4.0)


def test_what_is_told_reaches_the_team():
    team, asked = led(set())
    team.send_map("a", None)
    team.forget_walls("b", "trail")
    assert asked == [("send_map", "a", None), ("forget_walls", "b", "trail")]
