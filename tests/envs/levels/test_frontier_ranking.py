"""Which of many frontiers are offered."""

import numpy as np
import pytest

from lidarium.envs.levels.frontier_choices import choose_offers


def plain_offers(left, sizes, is_wanted, by_size, most):
    """Choose as the kernel does, by sorting."""
    wanted = np.flatnonzero(is_wanted)
    by_cost = wanted[np.argsort(-left[wanted], kind="stable")]
    cheapest = by_cost[: most - by_size]
    others = np.setdiff1d(wanted, cheapest)
    longest = others[np.argsort(-sizes[others], kind="stable")][:by_size]
    return [k for k in by_cost if k in cheapest or k in longest]


@pytest.mark.parametrize("by_size", [0, 1, 4, 8])
@pytest.mark.parametrize("clusters", [0, 3, 8, 9, 40])
def test_offers_are_the_cheapest_and_the_longest_of_the_others(clusters, by_size):
    generator = np.random.default_rng(clusters + by_size)
    for _ in range(20):
        left, sizes = generator.integers(0, 50, clusters), generator.integers(1, 20, clusters)
        is_wanted, ranked = generator.random(clusters) < 0.8, np.empty(8, np.int64)
        wanted = plain_offers(left, sizes, is_wanted, by_size, 8)
        count = choose_offers(left, sizes, is_wanted.copy(), by_size, ranked)
        assert ranked[:count].tolist() == wanted
