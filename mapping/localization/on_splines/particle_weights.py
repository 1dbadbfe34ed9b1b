"""How well particles explain what was matched: features and rays."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.kernels.compilation import Array, kernel

_HIT_SHARE = 0.95
_ENTRIES_PER_METRE, _FARTHEST = 2000.0, 0.5


def ray_likelihoods(sigma: float) -> NDArray[np.float64]:
    """Return log-likelihood and likelihood of a ray, shape (entries, 2).

    By the distance of the ray's end from a curve.
    """
    gaps = (np.arange(round(_FARTHEST * _ENTRIES_PER_METRE)) + 0.5) / _ENTRIES_PER_METRE
    likelihoods = _HIT_SHARE * np.exp(-0.5 * (gaps / sigma) ** 2) + 1.0 - _HIT_SHARE
    likelihoods[-1] = 1.0 - _HIT_SHARE
    return np.stack([np.log(likelihoods), likelihoods], axis=1)


class MatchedFeatures(NamedTuple):
    """Features as seen and in the map, and their deviations; see ``Matches``."""

    seen: Array
    known: Array
    sigmas: Array


@kernel
def weigh_features(
    particles: Array,
    matched_points: MatchedFeatures,
    matched_lines: MatchedFeatures,
    angle_sigma: float,
    logarithms: Array,
) -> None:
    """Add to each particle's log-likelihood (particles,) how well features fit."""
    points, known_points, point_sigmas = matched_points
    lines, known_lines, line_sigmas = matched_lines
    cosines, sines = np.cos(particles[:, 2]), np.sin(particles[:, 2])
    for k in range(points.shape[0]):
        for i in range(particles.shape[0]):
            dx = particles[i, 0] + cosines[i] * points[k, 0] - sines[i] * points[k, 1] - known_points[k, 0]
            dy = particles[i, 1] + sines[i] * points[k, 0] + cosines[i] * points[k, 1] - known_points[k, 1]
            logarithms[i] -= 0.5 * (dx * dx + dy * dy) / (point_sigmas[k] * point_sigmas[k])
    for k in range(lines.shape[0]):
        along_x, along_y = math.cos(known_lines[k, 2]), math.sin(known_lines[k, 2])
        for i in range(particles.shape[0]):
            dx = particles[i, 0] + cosines[i] * lines[k, 0] - sines[i] * lines[k, 1] - known_lines[k, 0]
            dy = particles[i, 1] + sines[i] * lines[k, 0] + cosines[i] * lines[k, 1] - known_lines[k, 1]
            aside = dy * along_x - dx * along_y
            turns = (particles[i, 2] + lines[k, 2] - known_lines[k, 2]) / (2.0 * math.pi)
            turn = (turns - math.floor(turns + 0.5)) * (2.0 * math.pi)
            logarithms[i] -= 0.5 * ((aside / line_sigmas[k]) ** 2 + (turn / angle_sigma) ** 2)


@kernel
def weigh_rays(
    particles: Array,
    rays: Array,
    pieces: Array,
    ray_table: Array,
    share: float,
    logarithms: Array,
    fits: Array,
) -> None:
    """Weigh particles by the distances of ray ends from their matched pieces.

    Rays are (k, 2), pieces (k, 5). Writes how well the rays fit, from 0.05 to 1.
    """
    last_entry = ray_table.shape[0] - 1
    cosines, sines = np.cos(particles[:, 2]), np.sin(particles[:, 2])
    for k in range(rays.shape[0]):
        ray_x, ray_y = rays[k]
        middle_x, middle_y, along_x, along_y, _ = pieces[k]
        for i in range(particles.shape[0]):
            dx = particles[i, 0] + cosines[i] * ray_x - sines[i] * ray_y - middle_x
            dy = particles[i, 1] + sines[i] * ray_x + cosines[i] * ray_y - middle_y
            entry = min(int(abs(dy * along_x - dx * along_y) * _ENTRIES_PER_METRE), last_entry)
            logarithms[i] += share * ray_table[entry, 0]
            fits[i] += ray_table[entry, 1] / rays.shape[0]
