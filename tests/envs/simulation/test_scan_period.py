"""Robots that scan at multiples of a period only; maps and scores follow their scans."""

import numpy as np
import pytest
from compared_faces import compare_rows

import lidarium
from lidarium.envs.settings.making import make_settings
from lidarium.envs.simulation.backends import kinematic_world, simulation_of
from lidarium.envs.simulation.kinematic_simulation import KinematicSimulation
from lidarium.envs.simulation.simulation import Simulation
from lidarium.evaluation.record import rerun

STEPS = 3
"""Steps from scan to scan."""

SLOW = {"scan_period_s": 0.1 * STEPS, "lidar": {"beams": 91}, "robots": 2, "noise": "datasheet"}
KEPT = ("ranges", "seen", "log_odds", "masks")
"""What scans alone change."""


def kept(env):
    owners = (env.simulation, env.score, env.beliefs)
    values = {name: next(getattr(owner, name) for owner in owners if hasattr(owner, name)) for name in KEPT}
    return {name: [np.array(each) for each in value] for name, value in values.items()}


def same(one, other):
    return all(np.array_equal(a, b) for name in one for a, b in zip(one[name], other[name], strict=True))


def started(floor="apartment", seed=4, **options):
    env = lidarium.parallel_env(floor, **{**SLOW, **options})
    env.reset(seed=seed)
    return env.unwrapped


def test_robots_scan_at_multiples_of_the_period_as_those_that_scan_in_each_step():
    slow, plain = started(), started(scan_period_s=None)
    generator = np.random.default_rng(0)
    for step in range(1, 4 * STEPS + 1):
        before = kept(slow)
        actions = {agent: generator.uniform(-0.5, 1.0, 2).astype(np.float32) for agent in slow.agents}
        slow.step(actions)
        plain.step(actions)
        assert np.array_equal(slow.world.poses, plain.world.poses)
        scans = step % STEPS == 0
        assert same(kept(slow), before) != scans
        assert np.array_equal(slow.simulation.ranges, plain.simulation.ranges) == scans
        if scans:
            scan_poses = slow.world.poses.copy()
        if step >= STEPS:
            assert np.allclose(slow.simulation.scan_poses, scan_poses, rtol=0.0, atol=1e-9)
    assert (slow.score.seen <= plain.score.seen).all()


@pytest.mark.parametrize("options", [{}, {"localization": "odometry", "odometry": "poor"}], ids=["truth", "odometry"])
def test_one_kernel_call_does_what_the_parts_do(options):
    settings = make_settings(**{**SLOW, **options})
    floor, generator = started().engine.starts[0], np.random.default_rng(1)
    forms = [simulation_of(kinematic_world(settings), settings, kind) for kind in (KinematicSimulation, Simulation)]
    for form in forms:
        form.place(0, floor.tables, floor.starts, 7)
        form.step(np.zeros((2, 2)), moves_bodies=False)
    for _ in range(3 * STEPS + 1):
        commands = generator.uniform(-0.3, 0.6, (2, 2))
        for form in forms:
            form.step(commands)
        fused, staged = forms
        for name in ("ranges", "measured"):
            assert np.array_equal(getattr(fused, name), getattr(staged, name))
        assert np.array_equal(fused.beliefs.scanned, staged.beliefs.scanned)
        assert all(np.array_equal(*maps) for maps in zip(fused.beliefs.log_odds, staged.beliefs.log_odds, strict=True))
        assert np.array_equal(fused.score.seen, staged.score.seen)


@pytest.mark.parametrize("level", ["velocity", "frontier"])
def test_rows_of_a_batch_are_single_environments(level):
    compare_rows(level, 2, 8, ("scene_room", "apartment"), seed=2, scan_period_s=0.4)


def test_robots_that_go_from_node_to_node_arrive_with_a_scan():
    env = started(level="graph", scan_period_s=0.7, graph={"spacing": 1.0, "least_utility": 0}, robot="point")
    for _ in range(4):
        env.step(dict.fromkeys(env.agents, 0))
        assert env.agents
        assert env.world.steps[0] % 7 == 0
        assert np.array_equal(env.simulation.scan_poses[:, :2], env.world.poses[:, :2])


def test_recorded_episodes_of_the_fast_preset_run_again():
    settings = lidarium.make_settings(realism="fast", robots=2, horizon_s=6.0)
    found = lidarium.record("nearest_frontier", "apartment", settings, seed=1)
    assert found.header["settings"]["scan_period_s"] == settings.scan_period_s > settings.time_step
    assert rerun(found).world.steps[0] == 60


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"scan_period_s": 0.25}, r"scan_period_s is 0.25 s; want a whole multiple of the time step of 0.1 s"),
        ({"scan_period_s": 0.05}, "want a whole multiple of the time step"),
        ({"scan_period_s": 0.0}, "scan_period_s is 0.0; want a number above 0"),
        ({"scan_period_s": 0.4, "localization": "slam"}, "'slam' needs a scan in each step.* truth or odometry"),
        ({"realism": "fast", "camera": "xtion"}, "scan_period_s is 0.4 s, but the robots have a camera.*'fast'"),
    ],
)
def test_periods_that_cannot_be_kept_are_refused(options, message):
    with pytest.raises(ValueError, match=message):
        make_settings(**options)


def test_a_period_beyond_a_decision_is_refused():
    with pytest.raises(
        ValueError, match=r"scan_period_s is 2.5 s, longer than a decision of 2.0 s at level 'waypoint'"
    ):
        lidarium.parallel_env("apartment", level="waypoint", scan_period_s=2.5)
    assert lidarium.parallel_env("apartment", scan_period_s=2.5).unwrapped.settings.scan_steps == 25


def test_a_backend_that_does_not_know_the_period_is_refused(monkeypatch):
    from lidarium.envs.engine import beginnings

    plain = beginnings.BACKENDS["kinematic"]
    deaf = {"kinematic": lambda settings, episodes: plain(make_settings(settings, scan_period_s=None), episodes)}
    monkeypatch.setattr(beginnings, "BACKENDS", deaf)
    with pytest.raises(ValueError, match="'kinematic' scans every 1 steps, scan_period_s asks for 4"):
        lidarium.parallel_env("apartment", scan_period_s=0.4)
