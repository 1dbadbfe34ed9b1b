"""Collisions by way and by episode."""

from lidarium.evaluation import metrics


def test_collisions_are_told_by_kilometre_and_episode():
    assert metrics.collisions_per_km(3, [1000.0, 500.0]) == 2.0
    assert metrics.collisions_per_km(0, [0.0]) is None
    assert metrics.collisions_per_episode([0, 1, 2]) == 1.0
    assert metrics.collisions_per_episode([]) is None
