"""How a robot travels along the legs of a way."""

import functools
import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from srt_halls import hall, senses_at

from lidarium.agents.srt.senses import Senses
from lidarium.agents.srt.settings import SrtSettings
from lidarium.agents.srt.travel import BACKING_S, MAX_TURNS, Travel, _Progress, _TurnPlan
from lidarium.envs.settings.lidar import Lidar
from lidarium.envs.settings.robots import Robot

LIDAR = Lidar(beams=3)


@functools.cache
def memory_of_hall():
    return hall([])


def travel(**settings):
    return Travel(SrtSettings(**settings), Robot(), LIDAR)


def leg(x, y):
    """A leg to a place of the hall, as of a way that was chosen."""
    return SimpleNamespace(place=np.array([x + 1.0, y + 1.0]), candidate=f"at {x:g}", is_goal=False)


def later(senses, seconds):
    return replace(senses, time_s=senses.time_s + seconds)


def test_the_target_is_what_the_last_leg_leads_to():
    one, there = travel(), senses_at(2.0, 2.0)
    assert one.target is None
    one.set_out([leg(4.0, 2.0), leg(8.0, 3.0)], there, is_aside=True)
    assert (one.target, one.is_aside) == ("at 8", True)
    assert one.began_at.tolist() == [3.0, 3.0]
    one.end_leg()
    assert [each.candidate for each in one.legs] == ["at 8"]
    one.drop()
    assert one.target is None


def test_corners_are_cut_where_the_map_has_room():
    one, there = travel(memory="map"), senses_at(2.0, 2.0)
    one.set_out([leg(4.0, 0.5), leg(5.0, 3.0), leg(9.0, 2.0)], there)
    one.begin_leg(there, memory_of_hall())
    assert [each.candidate for each in one.legs] == ["at 9"]
    kept = travel(memory="regions")
    kept.set_out([leg(4.0, 0.5), leg(9.0, 2.0)], there)
    kept.begin_leg(there, memory_of_hall())
    assert len(kept.legs) == 2


def test_a_leg_ends_where_the_robot_is_at_its_end():
    one, there = travel(), senses_at(2.0, 2.0)
    one.set_out([leg(4.0, 2.0)], there)
    one.begin_leg(there, memory_of_hall())
    speed, turn_rate = one.drive(there)
    assert speed >= 0.0
    assert abs(turn_rate) < 0.1
    assert one.drive(senses_at(4.0, 2.0)) is None


def test_a_blocked_robot_backs_out_for_a_while():
    one, there = travel(), senses_at(2.0, 2.0)
    assert not one.is_backing(there)
    one.back_out(there)
    assert one.is_backing(later(there, 0.99 * BACKING_S))
    assert not one.is_backing(later(there, BACKING_S))


@pytest.mark.parametrize(("heading", "sign"), [(math.pi / 2.0, 1.0), (-math.pi / 2.0, -1.0)])
def test_a_robot_turns_on_the_spot_no_faster_than_it_can_until_it_is_there(heading, sign):
    one, there = travel(), senses_at(2.0, 2.0)
    one.follow([leg(4.0, 2.0)], there)
    focus = there.pose[:2] + np.array([0.0, sign])
    one.turns.plan_frontier(focus, there)
    assert one.turn(there) == pytest.approx((0.0, sign * one.limits.turn_rate))
    assert one.turn(senses_at(2.0, 2.0, heading)) is None


def test_a_robot_looks_around_only_where_it_is_asked_to():
    for looks_around in (True, False):
        one = travel(looks_around=looks_around)
        one.look_around(senses_at(2.0, 2.0))
        assert one.turns.is_over is not looks_around


def test_blocks_at_one_place_are_counted_in_a_row():
    def there(x, time_s):
        return Senses(time_s, np.array([x, 0.0, 0.0]), np.empty(0, np.float32), False, None, [])

    progress = _Progress()
    assert [progress.note_block(there(x, 0.0)) for x in (1.0, 1.3, 1.1, 3.0, 3.2, 1.0)] == [1, 2, 3, 1, 2, 1]
    progress.stand(there(1.0, 10.0))
    assert not progress.is_stuck(there(1.01, 12.9))
    assert progress.is_stuck(there(1.01, 13.2))
    assert not progress.is_stuck(there(1.2, 13.3))


def facing(heading, x=0.0, y=0.0):
    return SimpleNamespace(pose=np.array([x, y, heading]))


def lidar(degrees, beams=100):
    return SimpleNamespace(field_of_view=math.radians(degrees), beams=beams)


def headings_of(plan):
    found = []
    while not plan.is_over:
        found.append(plan.error(facing(0.0)))
        plan.end_turn()
    return found


@pytest.mark.parametrize("degrees", [60.0, 90.0, 120.0, 240.0, 270.0])
@pytest.mark.parametrize("heading", [0.0, 2.5])
def test_after_all_turns_the_whole_circle_was_seen(degrees, heading):
    plan = _TurnPlan()
    plan.plan_circle(facing(heading), lidar(degrees))
    headings = [heading, *headings_of(plan)]
    assert len(headings) == math.ceil(360.0 / degrees)
    around = np.linspace(-math.pi, math.pi, 721)
    gaps = np.abs([np.angle(np.exp(1j * (around - each))) for each in headings]).min(axis=0)
    assert gaps.max() <= math.radians(degrees) / 2.0 + 1e-9


@pytest.mark.parametrize(
    "laser",
    [lidar(360.0), lidar(360.0 / (MAX_TURNS + 2)), lidar(240.0, beams=1)],
    ids=["full", "narrow", "beam"],
)
def test_a_laser_that_sees_all_or_hardly_anything_does_not_turn(laser):
    plan = _TurnPlan()
    plan.plan_circle(facing(0.0), laser)
    assert plan.is_over


def test_a_robot_turns_to_a_frontier_the_short_distance():
    plan = _TurnPlan()
    focus = np.array([-1.0, 2.0])
    plan.plan_frontier(focus, facing(3.0, 1.0, 2.0))
    assert plan.focus is focus
    assert plan.error(facing(3.0)) == pytest.approx(math.pi - 3.0)
    assert plan.error(facing(-3.0)) == pytest.approx(3.0 - math.pi)
    plan.end_turn()
    assert plan.is_over
    assert plan.focus is focus
