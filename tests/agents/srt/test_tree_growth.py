"""One robot's part in the growth of the tree."""

import math

import numpy as np
import pytest
from srt_halls import RADIUS, hall

from lidarium.agents.srt.memories.region_memory import RegionMemory
from lidarium.agents.srt.senses import Senses
from lidarium.agents.srt.settings import SrtSettings
from lidarium.agents.srt.tree import Tree
from lidarium.agents.srt.tree_growth import NEW_NODE, TreeGrowth
from lidarium.envs.settings.lidar import Lidar

LIDAR = Lidar(beams=360, field_of_view=2.0 * math.pi, range_max=6.0)
MEMORY = hall([])


def at(x, y, ranges=2.0):
    scan = np.full(LIDAR.beams, ranges, np.float32)
    return Senses(0.0, np.array([x, y, 0.0]), scan, False, None, [])


def planted(tree=None, agent="robot_0", **settings):
    growth = TreeGrowth(agent, tree or Tree(), SrtSettings(**settings), LIDAR, RADIUS)
    growth.plant(at(4.0, 3.0), MEMORY)
    return growth


def test_the_first_node_is_the_root_where_the_robot_is():
    growth = planted()
    assert (growth.root, growth.number, growth.count, growth.known) == (0, 0, 1, {0})
    assert growth.node.place.tolist() == [4.0, 3.0]
    assert growth.node.parent is None
    assert growth.node.agent == "robot_0"


def test_a_robot_makes_a_node_only_apart_from_its_last_one():
    growth = planted()
    growth.add_if_apart(at(4.0 + 0.9 * NEW_NODE, 3.0), MEMORY)
    assert growth.count == 1
    growth.add_if_apart(at(5.0, 3.0), MEMORY)
    assert (growth.count, growth.number, growth.node.parent) == (2, 1, 0)
    assert 0 in growth.node.neighbours


def test_a_robot_that_comes_to_a_node_joins_it_with_the_last_one():
    growth = planted()
    for x in (5.0, 6.0):
        growth.add(at(x, 3.0, 0.5), growth.number, np.array([x, 3.0, 0.0]), RegionMemory([]))
    assert growth.move_to(0).number == 0
    assert growth.number == 0
    assert 2 in growth.node.neighbours
    assert 0 in growth.tree.nodes[2].neighbours


def test_another_scan_at_a_place_shows_what_the_first_did_not():
    growth = TreeGrowth("robot_0", Tree(), SrtSettings(), LIDAR, RADIUS)
    blind = at(4.0, 3.0)
    blind.scan[LIDAR.beams // 4 : 3 * LIDAR.beams // 4] = np.nan  # nothing is known ahead
    growth.plant(blind, MEMORY)
    ahead, behind = np.array([5.0, 3.0]), np.array([3.0, 3.0])
    assert not growth.node.safe.contains(ahead)
    assert growth.node.safe.contains(behind)
    growth.widen_view(at(4.0, 3.0))
    assert growth.node.safe.contains(ahead)
    assert growth.node.safe.contains(behind)


@pytest.mark.parametrize(("perception", "expected"), [(4.0, 4.0), (9.0, 6.0)])
def test_a_robot_perceives_no_farther_than_its_laser(perception, expected):
    assert planted(perception=perception).perception == expected
