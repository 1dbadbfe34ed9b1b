"""Policies, which decide by observations and beliefs alone."""

from lidarium.agents.catalogue import make_policy, policy_names, register_policy
from lidarium.agents.policy import PerRobot, Policy, Stop, Team
from lidarium.agents.report import GivenUp, PolicyReport

__all__ = [
    "GivenUp",
    "PerRobot",
    "Policy",
    "PolicyReport",
    "Stop",
    "Team",
    "make_policy",
    "policy_names",
    "register_policy",
]
