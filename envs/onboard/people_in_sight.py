"""Positions of the people whom a robot recognises in its scan."""

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.simulation.kernels.arrays import PERSON_BEAM
from lidarium.envs.simulation.simulation import Simulation
from lidarium.mapping.geometry.rigid import Transform

BODY_M = 0.28
"""Radius that robots assume of a person [m]."""

NOBODY = np.zeros((0, 2))


def people_in_sight(simulation: Simulation, row: int, farthest: float) -> NDArray[np.float64]:
    """Return the middles x, y of people in a robot's last scan, (people, 2), in the frame of its believed pose [m].

    Neighbouring beams that met people are one person; those beyond ``farthest`` [m] are left out.
    """
    if simulation.population is None or not len(simulation.population.recognised):
        return NOBODY
    ranges, angles = simulation.ranges[row], simulation.lidars[row % simulation.robots].angles
    beams = np.flatnonzero((simulation.population.recognised[row] == PERSON_BEAM) & (ranges <= farthest))
    if not len(beams):
        return NOBODY
    groups = np.split(beams, np.flatnonzero(np.diff(beams) > 1) + 1)
    places = [(float(ranges[group].min()) + BODY_M, float(angles[group].mean())) for group in groups]
    reach, bearing = np.array(places).T
    ahead = np.column_stack([reach * np.cos(bearing), reach * np.sin(bearing)])
    return np.asarray(Transform(*simulation.beliefs.scanned[row].tolist()).apply(ahead), np.float64)
