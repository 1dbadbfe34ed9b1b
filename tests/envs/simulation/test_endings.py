"""Why robots end: the rules by an oracle, for one episode and for many."""

import numpy as np
import pytest

import lidarium
from lidarium.envs.simulation.endings import REASONS, make_rules, note_endings
from lidarium.mapping.kernels.views import table_of


def expected(env, rules, row):
    """The reason by the rules as they are documented, the first that holds."""
    world, settings = env.world, env.settings
    goal = rules.goals[0]
    holds = {
        "covered": settings.stop_coverage is not None and env.score.coverage(0) >= settings.stop_coverage,
        "failed": bool(world.failed[row]),
        "battery": bool(rules.is_empty[row]),
        "collision": settings.stop_on_contact and bool(world.contacts[row]),
        "reached": bool(np.hypot(*(world.poses[row, :2] - goal)) <= settings.goal_radius),
        "horizon": settings.horizon_steps is not None and world.steps[0] >= settings.horizon_steps,
    }
    return next((reason for reason, is_so in holds.items() if is_so), "") if rules.live[row] else ""


@pytest.mark.parametrize("seed", range(40))
def test_the_first_rule_that_holds_is_the_reason(seed):
    generator = np.random.default_rng(seed)
    env = lidarium.parallel_env(
        "scene_room",
        robots=3,
        stop_on_contact=bool(generator.integers(2)),
        stop_coverage=None if generator.random() < 0.5 else 0.5,
        horizon_s=None if generator.random() < 0.5 else 2.0,
        starts="fixed",
    )
    env.reset(seed=0)
    rules = make_rules(env.simulation, env.settings)
    rules.live[:], rules.is_empty[:] = generator.random(3) < 0.8, generator.random(3) < 0.2
    env.world.failed[:], env.world.contacts[:] = generator.random(3) < 0.2, generator.random(3) < 0.3
    env.world.steps[0] = generator.integers(10, 30)
    env.score.team_seen[0] = generator.random() * env.score.counted[0]
    if generator.random() < 0.5:
        rules.goals[0] = env.world.poses[0, :2] + 0.1
    reasons = np.zeros(3, np.int8)
    count = note_endings(env.simulation.table, 3, table_of(rules), reasons)
    assert [REASONS[number] for number in reasons] == [expected(env, rules, row) for row in range(3)]
    assert count == (reasons != 0).sum()
