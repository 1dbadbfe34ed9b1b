"""Starts of the robots of a trial."""

import numpy as np

from lidarium.envs.floors.floor import Floor
from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.envs.settings.limits import level_for


def drawn_starts(
    floor: str | Floor, settings: ExplorationSettings, seed: int, image_resolution: float | None = None
) -> list[list[float]] | None:
    """Draw start poses on a floor that has starts of its own.

    None on other floors, if a reset draws by the seed, and if the settings ask for the floor's starts.
    """
    from lidarium.envs.floors.catalogue.names import load_floor
    from lidarium.envs.floors.starts import draw_starts
    from lidarium.envs.simulation.kernels.floor_cache import floor_tables

    loaded = load_floor(floor, image_resolution)
    if settings.starts == "fixed" or not len(loaded.starts):
        return None
    tables = floor_tables(loaded, settings.raster_resolution, settings.lidar.height, settings.robot.height)
    drawn = draw_starts(tables.body, settings.robot.radius, settings.robots, np.random.default_rng(seed))
    return [[float(number) for number in start] for start in drawn]


def starts_for(
    floor: str, settings: ExplorationSettings, seed: int, image_resolution: float | None = None
) -> list[list[float]]:
    """Return the start poses of an episode of a suite: drawn, or the floor's if the settings ask for them."""
    where = floor, settings, seed, image_resolution
    return drawn_starts(*where) or starts_in(*where)


def starts_in(
    floor: str, settings: ExplorationSettings, seed: int, image_resolution: float | None = None
) -> list[list[float]]:
    """Return the start poses of a reset with a seed on a floor, x, y, theta of each [m, rad]."""
    from lidarium.envs.faces.parallel import ExplorationEnv

    env = ExplorationEnv(floor, settings, image_resolution=image_resolution, level=level_for(settings.observe))
    env.reset(seed=seed)
    return [[float(number) for number in start] for start in env.world.starts]
