"""Weights of particles against plain definitions."""

import math

import numpy as np
import pytest

from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.localization.on_splines.particle_weights import (
    MatchedFeatures,
    ray_likelihoods,
    weigh_features,
    weigh_rays,
)

SIGMA = 0.03


@pytest.fixture
def rng():
    return np.random.default_rng(4)


def drawn(rng, count=7):
    return rng.uniform([-1.0, -1.0, -math.pi], [1.0, 1.0, math.pi], (count, 3))


def test_features_weigh_by_their_distances_and_turns(rng):
    particles = drawn(rng)
    points = MatchedFeatures(rng.normal(size=(4, 2)), rng.normal(size=(4, 2)), rng.uniform(0.1, 0.5, 4))
    lines = MatchedFeatures(drawn(rng, 3), drawn(rng, 3), rng.uniform(0.1, 0.5, 3))
    found, expected = np.zeros(len(particles)), np.zeros(len(particles))
    weigh_features(particles, points, lines, 0.2, found)
    for i, particle in enumerate(particles.tolist()):
        pose = Transform(*particle)
        for seen, known, sigma in zip(*points, strict=True):
            expected[i] -= 0.5 * (math.dist(pose.apply(seen[None])[0], known) / sigma) ** 2
        for seen, known, sigma in zip(*lines, strict=True):
            gap = pose.apply(seen[None, :2])[0] - known[:2]
            aside = gap[1] * math.cos(known[2]) - gap[0] * math.sin(known[2])
            turn = math.remainder(particle[2] + seen[2] - known[2], 2.0 * math.pi)
            expected[i] -= 0.5 * ((aside / sigma) ** 2 + (turn / 0.2) ** 2)
    np.testing.assert_allclose(found, expected, rtol=1e-9)


def test_rays_weigh_by_the_distances_of_their_ends_from_pieces(rng):
    particles, rays = drawn(rng), rng.uniform(-1.0, 1.0, (5, 2))
    along = rng.uniform(0.0, math.pi, 5)
    pieces = np.column_stack([rng.uniform(-1, 1, (5, 2)), np.cos(along), np.sin(along), np.ones(5)])
    logarithms, fits = np.zeros(len(particles)), np.zeros(len(particles))
    weigh_rays(particles, rays, pieces, ray_likelihoods(SIGMA), 0.5, logarithms, fits)
    for i, particle in enumerate(particles.tolist()):
        ends = Transform(*particle).apply(rays) - pieces[:, :2]
        gaps = np.abs(ends[:, 1] * pieces[:, 2] - ends[:, 0] * pieces[:, 3])
        likelihoods = 0.95 * np.exp(-0.5 * (gaps / SIGMA) ** 2) + 0.05
        assert logarithms[i] == pytest.approx(0.5 * np.log(likelihoods).sum(), abs=0.05)
        assert fits[i] == pytest.approx(likelihoods.mean(), abs=0.01)


def test_a_ray_that_ends_on_its_curve_fits_and_one_that_ends_far_off_hardly_does():
    table = ray_likelihoods(SIGMA)
    assert table[0, 1] == pytest.approx(1.0, abs=1e-3)
    assert table[-1, 1] == pytest.approx(0.05)
    assert (np.diff(table, axis=0) <= 0.0).all()
    np.testing.assert_allclose(table[:, 0], np.log(table[:, 1]), atol=1e-9)
