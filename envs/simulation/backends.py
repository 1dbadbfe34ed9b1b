"""The backends by name: functions that make a simulation from settings."""

from collections.abc import Callable

from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.envs.simulation.backend import World
from lidarium.envs.simulation.kinematic_simulation import KinematicSimulation
from lidarium.envs.simulation.kinematic_world import KinematicWorld
from lidarium.envs.simulation.rewards import reward_weights
from lidarium.envs.simulation.simulation import PoseSources, Simulation
from lidarium.registry import Registry

BACKENDS: Registry[Callable[[ExplorationSettings, int], Simulation]] = Registry("backend")
"""Functions that make the simulation of a number of episodes, by name."""


def kinematic_world(settings: ExplorationSettings, episodes: int = 1) -> KinematicWorld:
    """Return the kinematic world of that many episodes."""
    return KinematicWorld(
        settings.team,
        settings.team_lidars,
        settings.time_step,
        episodes,
        settings.odometry,
        settings.localization != "truth",
        settings.faults,
        settings.horizon_s,
        settings.scan_steps,
        settings.people,
        settings.doors,
    )


def simulation_of(world: World, settings: ExplorationSettings, kind: type[Simulation] = Simulation) -> Simulation:
    """Return the simulation of a world, with the beliefs and the score that settings ask for."""
    simulation = kind(
        world,
        settings.team_lidars,
        settings.occupancy,
        settings.time_step,
        settings.threads,
        settings.egocentric_scales,
        reward_weights(settings),
        PoseSources(settings.localization, settings.radio.is_ideal),
        settings.scan_steps,
    )
    if settings.camera is not None:
        simulation.mount(settings.camera)
    return simulation


def make_kinematic(settings: ExplorationSettings, episodes: int = 1) -> Simulation:
    """Return the fused simulation of a kinematic world."""
    return simulation_of(kinematic_world(settings, episodes), settings, KinematicSimulation)


BACKENDS.register("kinematic", make_kinematic, "bodies follow commands exactly; fast")
BACKENDS.register(
    "bullet",
    "lidarium.envs.simulation.bullet.making:make_bullet",
    "PyBullet moves the bodies: wheels that slip, contact, table tops; needs the extra bullet",
)
