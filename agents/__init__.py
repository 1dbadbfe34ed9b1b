"""Policies: they only decide."""

from lidarium.agents import catalogue as catalogue
from lidarium.agents.policy import (
    GivenUp,
    PerRobot,
    Policy,
    Stop,
    Team,
    make_policy,
    policy_names,
    register_policy,
)

__all__ = ["GivenUp", "PerRobot", "Policy", "Stop", "Team", "make_policy", "policy_names", "register_policy"]
