"""Which robots reach each other, some through others."""

import numpy as np
import pytest

from lidarium.envs.faces.team_exchange import check_links, clusters_of


def plain_clusters(agents, links):
    """Return the clusters by walking from each agent in turn."""
    found = []
    for start in range(len(agents)):
        reached, left = set(), [start]
        while left:
            here = left.pop()
            if here not in reached:
                reached.add(here)
                left += np.flatnonzero(links[here]).tolist()
        found.append(tuple(sorted(reached)))
    return {tuple(agents[k] for k in one) for one in found}


@pytest.mark.parametrize("robots", [1, 2, 5, 17])
def test_clusters_are_what_can_be_walked_to(robots):
    agents = [f"robot_{k}" for k in range(robots)]
    for seed in range(10):
        links = check_links(np.random.default_rng(seed).random((robots, robots)) < 0.1, robots)
        assert {tuple(cluster) for cluster in clusters_of(agents, links)} == plain_clusters(agents, links)


def test_a_chain_is_one_cluster_however_long():
    links = np.eye(64, k=1, dtype=bool)
    agents = [f"robot_{k}" for k in range(64)]
    assert clusters_of(agents, check_links(links, 64)) == [agents]
    assert clusters_of(agents[:2], np.zeros((2, 2), bool)) == [["robot_0"], ["robot_1"]]


def test_links_hold_in_both_directions():
    assert check_links(np.array([[0, 1], [0, 0]]), 2).tolist() == [[False, True], [True, False]]
    with pytest.raises(ValueError, match=r"can_talk has shape \(2, 3\); want \(2, 2\)"):
        check_links(np.zeros((2, 3)), 2)
