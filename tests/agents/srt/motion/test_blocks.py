"""What a blocked robot does."""

from types import SimpleNamespace

import pytest

from lidarium.agents.srt.motion.blocks import ASIDES, TEAMMATE_NEAR, Blocks, Remedy


def senses(*gaps):
    return SimpleNamespace(teammates=list(gaps), distance_to=lambda gap: gap)


def test_alone_a_robot_backs_out_and_every_third_time_steps_aside():
    blocks = Blocks()
    found = [blocks.remedy(senses(), here, is_goal=False) for here in range(4)]
    assert found == [Remedy.BACK_OUT, Remedy.BACK_OUT, Remedy.STEP_ASIDE, Remedy.BACK_OUT]
    assert blocks.asides == 0


@pytest.mark.parametrize(
    ("gap", "expected"), [(TEAMMATE_NEAR - 0.1, Remedy.STEP_ASIDE), (TEAMMATE_NEAR, Remedy.BACK_OUT)]
)
def test_a_robot_steps_aside_for_a_teammate_that_is_near(gap, expected):
    assert Blocks().remedy(senses(9.0, gap), 0, is_goal=False) is expected


def test_after_many_steps_aside_a_robot_backs_out_and_begins_anew():
    blocks = Blocks()
    found = [blocks.remedy(senses(0.5), 0, is_goal=False) for _ in range(ASIDES + 2)]
    assert found == [Remedy.STEP_ASIDE] * ASIDES + [Remedy.BACK_OUT, Remedy.STEP_ASIDE]


def test_a_goal_is_given_up_once_it_is_hopeless():
    blocks = Blocks()
    for _ in range(ASIDES):
        assert blocks.remedy(senses(), 0, is_goal=True) is not Remedy.GIVE_GOAL_UP
    assert not blocks.are_hopeless
    assert blocks.remedy(senses(), 0, is_goal=True) is Remedy.GIVE_GOAL_UP
    assert blocks.failures == 0
