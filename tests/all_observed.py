"""What all robots observe where settings are given whole, the absolute pose with it."""

from lidarium.envs.settings.exploration import ExplorationSettings

ALL = ExplorationSettings().observe
