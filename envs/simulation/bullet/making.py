"""The simulation of a world of PyBullet, from settings."""

from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.envs.simulation.backends import simulation_of
from lidarium.envs.simulation.bullet.bullet_world import BulletWorld
from lidarium.envs.simulation.simulation import Simulation


def make_bullet(settings: ExplorationSettings, episodes: int = 1) -> Simulation:
    """Return the simulation of a world of PyBullet."""
    world = BulletWorld(
        settings.team,
        settings.team_lidars,
        settings.time_step,
        episodes,
        settings.odometry,
        settings.faults,
        settings.horizon_s,
        settings.scan_steps,
        settings.people,
        settings.doors,
    )
    return simulation_of(world, settings)
