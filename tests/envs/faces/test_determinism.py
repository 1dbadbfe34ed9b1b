"""The same seed, the same run: all arrays of all steps; and copies in mid-episode go on alike."""

import copy
import pickle

import numpy as np
import pytest

import lidarium

LEVELS = ("velocity", "waypoint", "frontier")


def flattened(value, path=""):
    """All leaves of nested dicts as (path, array)."""
    if isinstance(value, dict):
        return [leaf for key, inner in sorted(value.items()) for leaf in flattened(inner, f"{path}/{key}")]
    return [(path, np.asarray(getattr(value, "value", value)))]


def assert_equal(one, other):
    one, other = flattened(one), flattened(other)
    assert [path for path, _ in one] == [path for path, _ in other]
    for (path, a), (_, b) in zip(one, other, strict=True):
        assert a.dtype == b.dtype, path
        assert np.array_equal(a, b), path


def differs(one, other):
    return any(not np.array_equal(a, b) for (_, a), (_, b) in zip(flattened(one), flattened(other), strict=True))


def sampled(env, generator, observations, level):
    if level == "frontier":
        return {
            agent: int(generator.choice(np.flatnonzero(observations[agent]["action_mask"]))) for agent in env.agents
        }
    return {agent: generator.uniform(-1.0, 1.0, 2).astype(np.float32) for agent in env.agents}


def run(env, seed, steps, level="velocity", options=None):
    """All that reset and step return, over some steps and a second reset without a seed."""
    generator = np.random.default_rng(1)
    record = []
    for part in range(2):
        outcome = env.reset(seed=seed if part == 0 else None, options=options)
        record.append(dict(enumerate(outcome)))
        for _ in range(steps):
            if not env.agents:
                break
            outcome = env.step(sampled(env, generator, outcome[0], level))
            record.append(dict(enumerate(outcome)))
    return record


@pytest.mark.parametrize("noise", ["none", "datasheet"])
@pytest.mark.parametrize("known_starts", [True, False])
def test_five_hundred_steps_and_two_resets_give_the_same_arrays_for_the_same_seed(noise, known_starts):
    first, second = (
        run(
            lidarium.parallel_env(
                "building:5",
                robots=3,
                noise=noise,
                known_starts=known_starts,
                stop_coverage=None,
                map_cells=64,
                starts="fixed",
            ),
            11,
            250,
        )
        for _ in range(2)
    )
    assert len(first) == 502
    for one, other in zip(first, second, strict=True):
        assert_equal(one, other)


def test_another_seed_gives_other_starts_noise_and_floors():
    records = [
        run(lidarium.parallel_env("building:5", robots=2, noise="datasheet", map_cells=64, starts="fixed"), seed, 5)
        for seed in (1, 2)
    ]
    assert differs(records[0][0], records[1][0])
    env = lidarium.parallel_env("scene_room", robots=1, noise="datasheet", map_cells=64, starts="fixed")
    starts = env_starts(env)
    scans = [env.reset(seed=seed, options={"starts": starts})[0]["robot_0"]["scan"] for seed in (1, 2)]
    assert not np.array_equal(scans[0], scans[1])
    plain = lidarium.parallel_env("scene_room", robots=1, map_cells=64, starts="fixed")
    scans = [plain.reset(seed=seed, options={"starts": starts})[0]["robot_0"]["scan"] for seed in (1, 2)]
    assert np.array_equal(scans[0], scans[1])
    env = lidarium.parallel_env("set:train", robots=1, map_cells=64)
    assert len({(env.reset(seed=seed), env.floor.name)[1] for seed in range(6)}) > 3


def env_starts(env):
    env.reset(seed=0)
    return env.unwrapped.world.poses.copy()


def test_resets_without_a_seed_go_on_with_the_generator_and_differ():
    env = lidarium.parallel_env("building:5", robots=2, noise="datasheet", map_cells=64, starts="fixed")
    env.reset(seed=4)
    seeds = [env.seed]
    for _ in range(3):
        env.reset()
        seeds.append(env.seed)
    assert len(set(seeds)) == 4


def test_threads_do_not_change_an_episode():
    one, two = (
        run(
            lidarium.parallel_env(
                "scene_loop", robots=9, noise="datasheet", threads=threads, map_cells=64, starts="fixed"
            ),
            3,
            40,
        )
        for threads in (1, 2)
    )
    for first, second in zip(one, two, strict=True):
        assert_equal(first, second)


@pytest.mark.parametrize("level", LEVELS)
@pytest.mark.parametrize("how", ["pickle", "deepcopy"])
def test_a_copy_made_in_mid_episode_goes_on_alike_and_apart(level, how):
    env = lidarium.parallel_env("building:5", level=level, robots=3, noise="datasheet", map_cells=64, starts="fixed")
    generator = np.random.default_rng(2)
    observations = env.reset(seed=9)[0]
    for _ in range(8):
        observations = env.step(sampled(env, generator, observations, level))[0]
    copied = pickle.loads(pickle.dumps(env)) if how == "pickle" else copy.deepcopy(env)
    generators = [np.random.default_rng(3) for _ in range(2)]
    seen = [copy.deepcopy(observations) for _ in range(2)]
    # The original runs ahead, so that anything shared between the two would show.
    outcomes = [[], []]
    for which, each in enumerate((env, copied)):
        for _ in range(12):
            outcome = each.step(sampled(each, generators[which], seen[which], level))
            seen[which] = outcome[0]
            outcomes[which].append(dict(enumerate(outcome)))
    for one, other in zip(*outcomes, strict=True):
        assert_equal(one, other)
    assert_equal(env.reset()[0], copied.reset()[0])


@pytest.mark.parametrize("level", LEVELS)
def test_what_was_returned_earlier_is_not_overwritten(level):
    env = lidarium.parallel_env("building:5", level=level, robots=2, noise="datasheet", map_cells=64, starts="fixed")
    generator = np.random.default_rng(2)
    outcome = env.reset(seed=1)
    kept = []
    for _ in range(10):
        kept.append((outcome, copy.deepcopy(outcome)))
        outcome = env.step(sampled(env, generator, outcome[0], level))
    env.reset(seed=2)
    for returned, then in kept:
        assert_equal(dict(enumerate(returned)), dict(enumerate(then)))


def test_writing_into_what_was_returned_changes_nothing_later():
    envs = [
        lidarium.parallel_env("building:5", robots=2, noise="datasheet", map_cells=64, starts="fixed") for _ in range(2)
    ]
    outcomes = [env.reset(seed=1) for env in envs]
    for _ in range(5):
        for _, leaf in flattened(outcomes[0][0]):
            leaf[...] = 0
        for info in outcomes[0][-1].values():
            info["truth"]["pose"][:] = 99.0
        outcomes = [env.step({agent: np.array([0.4, 0.2], np.float32) for agent in env.agents}) for env in envs]
        assert_equal(outcomes[0][0], outcomes[1][0])
        assert_equal(outcomes[0][-1], outcomes[1][-1])


def test_actions_given_are_not_changed():
    env = lidarium.parallel_env("building:5", robots=1, map_cells=64, starts="fixed")
    env.reset(seed=1)
    action = np.array([3.0, -3.0], np.float32)
    env.step({"robot_0": action})
    assert action.tolist() == [3.0, -3.0]
