"""People and doors whom a robot recognises in its scan and its images."""

import math

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.simulation.kernels.arrays import (
    DOOR_KIND,
    OPENS,
    PERSON_BEAM,
    WALKER_RADIUS,
    WALKER_X,
    WALKER_Y,
)
from lidarium.envs.simulation.kernels.contact import has_leaf, leaf_of
from lidarium.envs.simulation.simulation import Simulation
from lidarium.mapping.geometry.rigid import Transform

BODY_M = 0.28
"""Radius that robots assume of a person [m]."""

NOBODY = np.zeros((0, 2))

LEAF_STEP_M = 0.1
"""Distance between the discs that cover the leaf of a door [m]."""


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


def bodies_recognised(simulation: Simulation, row: int, farthest: float) -> NDArray[np.float64]:
    """Return discs x, y and radius (N, 3) over people and doors that a robot recognises in its depth images [m].

    They lie in the frame of its believed pose. Doors are those that open by themselves; those that stay shut are
    walls to it. Who is beyond ``farthest`` [m] is left out.
    """
    population, episode = simulation.population, row // simulation.robots
    if population is None:
        return np.zeros((0, 3))
    discs = [population.people_of(episode)[:, [WALKER_X, WALKER_Y, WALKER_RADIUS]]]
    for door in population.doors_of(episode):
        if door[DOOR_KIND] == OPENS and has_leaf(door):
            from_x, from_y, to_x, to_y = leaf_of(door)
            count = max(math.ceil(math.hypot(to_x - from_x, to_y - from_y) / LEAF_STEP_M), 1) + 1
            places = np.linspace((from_x, from_y, 0.0), (to_x, to_y, 0.0), count)
            discs.append(places + np.array([0.0, 0.0, 0.5 * LEAF_STEP_M]))
    found, pose = np.concatenate(discs), simulation.world.poses[row]
    found = found[np.hypot(*(found[:, :2] - pose[:2]).T) <= farthest + found[:, 2]]
    believed_from_true = Transform(*simulation.beliefs.believed[row].tolist()) @ Transform(*pose.tolist()).inverse()
    found[:, :2] = believed_from_true.apply(found[:, :2])
    return np.asarray(found)
