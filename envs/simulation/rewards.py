"""The terms of the reward that kernels add up in every step."""

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.mapping.kernels.compilation import Array, kernel

TERMS = ("area", "time", "contact", "energy")
"""Terms that kernels add up, named as the weights of ``RewardSettings``."""

AREA, TIME, CONTACT, ENERGY = range(len(TERMS))
"""Columns of weights and terms."""


def reward_weights(settings: ExplorationSettings) -> NDArray[np.float64]:
    """Return the value of a new cell and the costs, shape (4,).

    The costs are of a step, a contact and a metre.
    """
    weights = settings.reward
    numbers = np.zeros(len(TERMS))
    numbers[AREA] = weights.area * settings.occupancy.resolution**2
    numbers[TIME] = weights.time * settings.time_step
    numbers[CONTACT], numbers[ENERGY] = weights.contact, weights.energy
    return numbers


@kernel(nrt=False)
def add_rewards(
    gains: Array,
    contacts: Array,
    travelled: Array,
    weights: Array,
    travelled_before: Array,
    terms: Array,
    rewards: Array,
) -> None:
    """Add each robot's reward of a step: its share of new cells less the prices of time, contact, energy.

    Parameters
    ----------
    gains, contacts, travelled : (robots,) arrays
        Cells credited in the step, whether the body touched anything, and length of the path [m].
    weights : (4,) float64
        Reward of a new cell, and costs of a step, a contact and a metre.
    travelled_before : (robots,) float64
        Length of the path at the last reward [m]; updated.
    terms : (robots, 4) float64
        Amount of each term; added to.
    rewards : (robots,) float64
        Added to.
    """
    for robot in range(gains.shape[0]):
        driven = travelled[robot] - travelled_before[robot]
        travelled_before[robot] = travelled[robot]
        area, contact = weights[AREA] * gains[robot], weights[CONTACT] * contacts[robot]
        energy = weights[ENERGY] * driven
        rewards[robot] += area - weights[TIME] - contact - energy
        terms[robot, AREA] += area
        terms[robot, TIME] -= weights[TIME]
        terms[robot, CONTACT] -= contact
        terms[robot, ENERGY] -= energy
