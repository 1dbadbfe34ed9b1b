"""One robot of the tree: it looks around, goes where it is open, and home when it is done."""

import functools
import math
from itertools import pairwise

import numpy as np
import pytest
from driven_rooms import box, cast
from srt_halls import RADIUS, hall

from lidarium.agents.srt.explorer import NEW_NODE, Explorer, _TreeGrowth
from lidarium.agents.srt.memories import RegionMemory
from lidarium.agents.srt.senses import Senses
from lidarium.agents.srt.settings import SrtSettings, make_srt_settings
from lidarium.agents.srt.travel import BLIND_S, REST
from lidarium.agents.srt.tree import Tree
from lidarium.envs.settings.lidar import Lidar
from lidarium.envs.settings.robots import ROBOTS

LIDAR, ROBOT, PERIOD = Lidar(), ROBOTS["kobuki"], 0.1
# The hall of 12 m x 4 m, as it lies on its map.
WALLS, START = box(1.0, 1.0, 12.0, 4.0), (4.0, 3.0, 0.3)


class Run:
    """A robot in the hall that does as an explorer says."""

    def __init__(self, openings=(), goal=None, memory=None, start=START, **settings):
        self.memory, self.tree = memory or hall(openings), Tree()
        self.goal = None if goal is None else np.array(goal)
        self.pose, self.time_s = np.array(start), 0.0
        self.poses, self.commands, self.targets = [self.pose], [], []
        generator = np.random.default_rng(1)
        chosen = make_srt_settings(**settings)
        self.explorer = Explorer("robot_0", self.tree, chosen, ROBOT, LIDAR, generator)

    def step(self, moves=True, scan=None, teammates=()):
        scan = cast(WALLS, self.pose, LIDAR) if scan is None else scan
        senses = Senses(self.time_s, self.pose, scan, False, self.goal, list(teammates))
        speed, turn_rate = self.explorer.step(senses, self.memory, [])
        self.commands.append((speed, turn_rate))
        self.targets.append(self.explorer.target)
        if moves:
            middle = self.pose[2] + 0.5 * PERIOD * turn_rate
            gone = PERIOD * speed * np.array([math.cos(middle), math.sin(middle)])
            heading = math.remainder(self.pose[2] + PERIOD * turn_rate, math.tau)
            self.pose = np.array([*(self.pose[:2] + gone), heading])
        self.poses.append(self.pose)
        self.time_s += PERIOD

    def until_home(self, most=1500):
        while not self.explorer.is_home and len(self.commands) < most:
            self.step()
        return self

    def away(self):
        return math.dist(self.pose[:2], START[:2])


def test_a_robot_plants_its_first_node_and_looks_around():
    run = Run()
    assert run.explorer.root == -1
    run.step()
    assert run.explorer.root == 0
    assert run.explorer.known == {0}
    assert run.tree.nodes[0].pose.tolist() == list(START)
    assert np.isnan(run.tree.nodes[0].view).mean() == pytest.approx(1.0 / 3.0, abs=0.01)
    while not run.explorer.is_home:
        run.step()
    assert not any(speed for speed, _ in run.commands)
    # The laser sees 240 degrees: what lay behind is seen by turns on the spot.
    turned = sum(abs(math.remainder(b[2] - a[2], math.tau)) for a, b in pairwise(run.poses))
    assert turned > math.pi / 2
    # A turn ends a little before its heading.
    assert np.isnan(run.tree.nodes[0].view).mean() * math.tau <= make_srt_settings().turning_ends


def test_where_all_is_known_it_has_explored_and_stays_at_home():
    run = Run().until_home()
    assert run.explorer.ending == "explored"
    assert run.explorer.target is None
    for _ in range(10):
        run.step()
    assert run.commands[-10:] == [REST] * 10


def test_it_goes_to_what_is_open_and_comes_back_when_that_was_seen():
    memory = hall([(8.0, 9.5)])
    run = Run(memory=memory)
    while run.explorer.target is None and len(run.commands) < 300:
        run.step()
    assert run.explorer.target is not None
    assert not run.explorer.is_home
    run.until_home()
    assert run.explorer.ending == "explored"
    assert run.away() < 0.3
    # The opening is between x = 9 and 10.5 at the upper wall; what stays unseen there is given up.
    nearest = min(math.dist(pose[:2], (9.75, 5.0)) for pose in run.poses)
    assert nearest < 1.5
    assert len(run.tree.nodes) > 1


def test_a_goal_is_gone_to_and_one_that_ends_nothing_was_missed():
    run = Run(goal=(10.0, 3.0)).until_home()
    assert run.explorer.ending == "goal_missed"
    assert min(math.dist(pose[:2], (10.0, 3.0)) for pose in run.poses) < 0.15
    assert run.away() < 0.3


def test_a_goal_that_cannot_be_come_to_is_unreachable():
    run = Run(goal=(7.0, 5.6)).until_home()
    assert run.explorer.ending == "unreachable"
    assert run.away() < 0.3


@pytest.mark.parametrize("budget", [{"time_s": 8.0}, {"nodes": 1}])
def test_a_spent_budget_sends_it_home(budget):
    run = Run([(8.0, 9.5)], **budget).until_home()
    assert run.explorer.ending == "budget"
    assert run.away() < 0.5


def test_a_robot_that_sees_nothing_stands_and_gives_up_after_a_while():
    run, blind = Run(), np.full(LIDAR.beams, np.nan, np.float32)
    for _ in range(round(BLIND_S / PERIOD)):
        run.step(scan=blind)
        assert run.explorer.ending is None
    for _ in range(2):
        run.step(scan=blind)
    assert (run.explorer.ending, run.explorer.is_home) == ("blind", True)
    assert set(run.commands) == {REST}
    assert run.explorer.root == -1


def test_a_robot_that_is_held_backs_out():
    run = Run(goal=(10.0, 3.0))
    while run.away() < 1.0:
        run.step()
    held = len(run.commands)
    for _ in range(60):
        run.step(moves=False)
    speeds = [speed for speed, _ in run.commands[held:]]
    assert min(speeds) < 0.0
    # Not before it had reason to.
    assert min(speeds[:20]) >= 0.0


TREE_GROWTH_LIDAR = Lidar(beams=360, field_of_view=2.0 * math.pi, range_max=6.0)


@functools.cache
def memory_of_hall():
    return hall([])


def at(x, y, ranges=2.0):
    scan = np.full(TREE_GROWTH_LIDAR.beams, ranges, np.float32)
    return Senses(0.0, np.array([x, y, 0.0]), scan, False, None, [])


def planted(tree=None, agent="robot_0", **settings):
    growth = _TreeGrowth(agent, tree or Tree(), SrtSettings(**settings), TREE_GROWTH_LIDAR, RADIUS)
    growth.plant(at(4.0, 3.0), memory_of_hall())
    return growth


def test_the_first_node_is_the_root_where_the_robot_is():
    growth = planted()
    assert (growth.root, growth.number, growth.count, growth.known) == (0, 0, 1, {0})
    assert growth.node.place.tolist() == [4.0, 3.0]
    assert growth.node.parent is None
    assert growth.node.agent == "robot_0"


def test_a_robot_makes_a_node_only_apart_from_its_last_one():
    growth = planted()
    growth.add_if_apart(at(4.0 + 0.9 * NEW_NODE, 3.0), memory_of_hall())
    assert growth.count == 1
    growth.add_if_apart(at(5.0, 3.0), memory_of_hall())
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
    growth = _TreeGrowth("robot_0", Tree(), SrtSettings(), TREE_GROWTH_LIDAR, RADIUS)
    blind = at(4.0, 3.0)
    blind.scan[TREE_GROWTH_LIDAR.beams // 4 : 3 * TREE_GROWTH_LIDAR.beams // 4] = np.nan  # nothing is known ahead
    growth.plant(blind, memory_of_hall())
    ahead, behind = np.array([5.0, 3.0]), np.array([3.0, 3.0])
    assert not growth.node.safe.contains(ahead)
    assert growth.node.safe.contains(behind)
    growth.widen_view(at(4.0, 3.0))
    assert growth.node.safe.contains(ahead)
    assert growth.node.safe.contains(behind)


@pytest.mark.parametrize(("perception", "expected"), [(4.0, 4.0), (9.0, 6.0)])
def test_a_robot_perceives_no_farther_than_its_laser(perception, expected):
    assert planted(perception=perception).perception == expected
