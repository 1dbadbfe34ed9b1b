"""Settings of an environment."""

from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.envs.settings.lidar import Lidar
from lidarium.envs.settings.making import make_settings
from lidarium.envs.settings.rewards import RewardSettings
from lidarium.envs.settings.robots import Robot

__all__ = ["ExplorationSettings", "Lidar", "RewardSettings", "Robot", "make_settings"]
