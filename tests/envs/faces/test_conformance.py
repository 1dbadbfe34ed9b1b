"""Every face keeps the contract of its library: at every level, in every form, in every world.

The episodes of a single environment are recorded once; all other faces have to return the same to the bit.
"""

import functools
import math
import warnings
from collections import Counter
from importlib.util import find_spec

import gymnasium
import numpy as np
import pytest
from compared_faces import (
    actions_of_rows,
    assert_rows,
    assert_same,
    is_active,
    of_row,
    recorded,
    team_of,
    without_forms,
)
from gymnasium import spaces
from gymnasium.utils.env_checker import check_env
from linked_rooms import TWO_ROOMS
from pettingzoo.utils.conversions import parallel_to_aec

import lidarium
from lidarium.envs.engine.engine import Engine
from lidarium.envs.faces.conventions import FORMS, NAMES
from lidarium.envs.faces.gymnasium_env import SoloExploration
from lidarium.envs.faces.merged_maps import MergingSettings
from lidarium.envs.faces.randomized import zeros_of
from lidarium.envs.faces.sparse_planning import SparsePlanning
from lidarium.envs.settings.lidar import Lidar
from lidarium.envs.simulation.backends import kinematic_world, simulation_of

with warnings.catch_warnings():
    # Importing PettingZoo's tests imports its example environments in a deprecated way.
    warnings.simplefilter("ignore")
    from pettingzoo.test import api_test, parallel_api_test

SEED, STEPS = 5, 8
SMALL = {
    "robots": 2,
    "lidar": Lidar(beams=24, field_of_view=2.0 * math.pi, range_max=4.0),
    "map_cells": 36,
    "resolution": 0.1,
    "observe": ["scan", "pose", "map"],
    "starts": "drawn",
    "stop_coverage": None,
    "horizon_s": 0.6,
    "decision_period_s": 0.2,
}
OWN = "own"
"""Name of a level and a world of a user's own, which the tests register."""

LEVELS = [*lidarium.registry("level"), OWN]
BACKENDS = [*lidarium.registry("backend"), OWN]
NEEDS_BULLET = pytest.mark.skipif(find_spec("pybullet") is None, reason="the extra bullet is missing")
FORMED = {f"{name}={value}": {name: value} for name, values in FORMS.items() for value in values[1:]}
TALKING = {
    "comm": {"comm": 2},
    "all_forms": {"observation": "flat", "infos": "flat", "ended_agents": "zeros", "comm": 1},
}
TEAMS = {
    **TALKING,
    "merging": {"merging": MergingSettings(period_s=0.2, known_starts=True)},
    "drawn_sizes": {"randomize": {"robots": [3, 1]}},
    "merging_drawn_sizes": {
        "merging": MergingSettings(period_s=0.2, known_starts=True),
        "randomize": {"robots": [3, 2]},
    },
}
"""Options that only teams take."""

OPTIONS = {
    "plain": {},
    **FORMED,
    "team_reward": {"team_reward": 0.5},
    "unknown_starts": {"known_starts": False, "noise": "datasheet"},
    "odometry": {"localization": "odometry", "odometry": "poor"},
    "battery": {"battery": {"capacity_j": 4.0}},
    "camera": {"camera": "depth_64x48", "observe": ["pose", "map", "depth"]},
    "egocentric": {"observe": ["egocentric_map", "velocity", "bumper"], "egocentric_scales": (1, 2, 4)},
    "pauses": {"pauses_when_blocked": True},
    "people": {"people": 2, "doors": 1.0},
    "mixed": {"kinds": ["kobuki", "service"]},
    "drawn_settings": {"randomize": {"lidar.noise_floor": (0.0, 0.05), "reward.time": (0.0, 1.0)}},
    **TEAMS,
}
ALONE = [name for name in OPTIONS if name not in TEAMS]
"""Options that one robot takes as well."""

IN_EVERY_WORLD = ("camera", "all_forms")
"""Options that are tried with each backend; worlds know nothing of forms."""


def cases(names):
    """Every level with every option in the kinematic world, and with some in the others."""
    found = [
        pytest.param(level, backend, name, marks=[NEEDS_BULLET] * (backend == "bullet"))
        for level in LEVELS
        for backend in BACKENDS
        for name in names
        if backend == "kinematic" or name in IN_EVERY_WORLD
    ]
    return pytest.mark.parametrize(("level", "backend", "name"), found)


@pytest.fixture(scope="module", autouse=True)
def own_parts():
    """A level and a world of a user's own."""

    @lidarium.level(OWN, "a metre to the east, north, west or south")
    class Compass(lidarium.WaypointLevel):
        def __init__(self, *arguments):
            super().__init__(*arguments)
            self.action_space = spaces.Discrete(4)

        def read_rows(self, actions, live):
            angles = 0.5 * math.pi * np.asarray(actions)
            here = self.perception.beliefs.believed[:, :2] - self.perception.offsets
            return self.ways_to(here + np.stack([np.cos(angles), np.sin(angles)], axis=1), live)

    backends = lidarium.registry("backend")
    backends.register(OWN, lambda settings, episodes: simulation_of(kinematic_world(settings, episodes), settings), OWN)
    yield
    lidarium.registry("level").unregister(OWN)
    backends.unregister(OWN)


def options_of(level, backend, name):
    """Return options of an environment; masks elsewhere than inside are refused if the level has none."""
    options = {**SMALL, "backend": backend, **OPTIONS[name]}
    if level == "graph" and (backend == "bullet" or "localization" in options):
        with pytest.raises(ValueError, match="do not drive"):
            team_of(TWO_ROOMS, level, **options)
        pytest.skip("robots of the level graph are moved between nodes")
    if "action_mask" in options and level not in ("frontier", "graph", "tour"):
        with pytest.raises(ValueError, match="observations have none"):
            team_of(TWO_ROOMS, level, **options)
        pytest.skip(f"the level {level} has no mask")
    return options


def stop_one(episode, step, team):
    """Let the first robot of the first episode end by itself, unless it has: small rooms show nothing to a graph."""
    if (episode, step) == (0, 2) and "robot_0" in team.agents:
        team.stop("robot_0", "enough")


@functools.cache
def alone(level, backend, name, seed=SEED, robots=2):
    """Record a single environment."""
    env = team_of(TWO_ROOMS, level, **{**options_of(level, backend, name), "robots": robots})
    moments = recorded(env, seed, STEPS, before=functools.partial(stop_one, seed - SEED))
    env.close()
    return moments


every_level = pytest.mark.parametrize("level", LEVELS)
every_backend = pytest.mark.parametrize(
    "backend", [pytest.param(name, marks=[NEEDS_BULLET] * (name == "bullet")) for name in BACKENDS]
)


def test_every_convention_is_tried():
    assert {option for options in OPTIONS.values() for option in options} >= set(NAMES)


# PettingZoo's test warns if some agents are not in each episode, which its interface allows.
@pytest.mark.filterwarnings("ignore:No agents present:UserWarning")
@cases(OPTIONS)
def test_teams_keep_the_contract_of_pettingzoo(level, backend, name, capsys):
    options = options_of(level, backend, name)
    env = team_of(TWO_ROOMS, level, **options)
    parallel_api_test(env, num_cycles=7)
    assert "Passed" in capsys.readouterr().out
    moments = recorded(env, SEED, STEPS, before=functools.partial(stop_one, 0))
    check_contract(env, moments, options.get("infos", "full"), options.get("ended_agents") == "zeros")
    # An environment that was used does what a new one does.
    for moment, wanted in zip(moments, alone(level, backend, name), strict=True):
        assert_same(moment._asdict(), wanted._asdict())


def leaves(value):
    return [leaf for each in value.values() for leaf in leaves(each)] if isinstance(value, dict) else [value]


def check_contract(env, moments, form, stays):
    """Check types, spaces, and that agents leave or stay as they should."""
    assert sum(moment.is_over for moment in moments) >= 1
    for moment in moments:
        is_begin = not moment.rewards
        if is_begin:
            team, ended = set(moment.observations), set()
        there = team if stays else team - ended
        assert set(moment.observations) == set(moment.infos) == there
        assert env.state_space.contains(moment.state)
        for agent, observation in moment.observations.items():
            space = env.observation_space(agent)
            assert space.contains(observation)
            if isinstance(space, spaces.Dict):
                boxes = [part for name, part in space.items() if isinstance(part, spaces.Box) and name != "action_mask"]
                assert all(box.is_bounded() for box in boxes)
            check_info(moment.infos[agent], form, stays, agent in ended)
        if is_begin:
            continue
        assert set(moment.rewards) == set(moment.terminations) == set(moment.truncations) == there
        assert {type(reward) for reward in moment.rewards.values()} == {float}
        now = {agent for agent in there if moment.terminations[agent] or moment.truncations[agent]}
        assert {type(end) for ends in (moment.terminations, moment.truncations) for end in ends.values()} == {bool}
        assert not any(moment.terminations[agent] and moment.truncations[agent] for agent in there)
        for agent in there & ended:
            assert moment.rewards[agent] == 0.0
            # Nothing but that it may stay, if the level has a mask.
            shown = np.concatenate([leaf.ravel() for leaf in leaves(moment.observations[agent])])
            assert shown.sum() == np.count_nonzero(shown) == (env.unwrapped.level in ("frontier", "graph", "tour"))
        if stays:
            assert now in (set(), team)
            ended = ended | ({"robot_0"} if moment is moments[3] else set())
        else:
            ended = ended | now
        assert moment.is_over == (now == team if stays else ended == team)


def check_info(info, form, stays, has_ended):
    numbers = {name: value for name, value in info.items() if name != "action_mask"}
    if form == "full" and has_ended:
        assert info["ended_because"] == "enough"
    elif form == "full":
        assert {"truth", "state", "order", "reward_terms"} <= info.keys()
        assert {"pose", "coverage", "seen_cells"} <= info["truth"].keys()
    elif form == "flat":
        assert "truth.coverage" in numbers
        assert {type(value) for value in numbers.values()} == {float}
    else:
        assert not numbers
    if stays and form != "none":
        assert bool(info["active"]) != has_ended


# PettingZoo's test was written for observations that are arrays.
@pytest.mark.filterwarnings(
    "ignore:Observation is not a NumPy array", "ignore:.* space for each agent probably should be"
)
@cases(OPTIONS)
def test_turn_based_teams_keep_the_contract_and_do_what_parallel_ones_do(level, backend, name, capsys):
    options = options_of(level, backend, name)
    env = parallel_to_aec(team_of(TWO_ROOMS, level, **options))
    if "merging" not in options:
        assert type(lidarium.env(TWO_ROOMS, level=level, **options)) is type(env)
    api_test(env, num_cycles=3)
    assert "Passed" in capsys.readouterr().out
    moments, counts = alone(level, backend, name), Counter()
    for agent in env.possible_agents:
        env.action_space(agent).seed(0)
    env.reset(seed=SEED)
    for agent in env.agent_iter():
        observation, reward, terminated, truncated, info = env.last()
        moment = moments[counts[agent]]
        assert_same(observation, moment.observations[agent])
        assert_same(info, moment.infos[agent])
        assert reward == moment.rewards.get(agent, 0.0)
        assert (terminated, truncated) == (
            moment.terminations.get(agent, False),
            moment.truncations.get(agent, False),
        )
        if agent == "robot_0":
            stop_one(0, counts[agent], env.unwrapped)
        counts[agent] += 1
        env.step(None if terminated or truncated else moments[counts[agent]].actions[agent])
    assert moments[max(counts.values()) - 1].is_over


@cases(ALONE)
def test_one_robot_keeps_the_contract_of_gymnasium_and_is_a_team_of_one(level, backend, name):
    options = {**options_of(level, backend, name), "robots": 1}
    env = gymnasium.make("lidarium/Exploration-v1", floor=TWO_ROOMS, level=level, **options).unwrapped
    check_env(env, skip_render_check=True)
    moments = alone(level, backend, name, robots=1)
    for step, moment in enumerate(moments):
        outcome = env.step(moment.actions["robot_0"]) if moment.rewards else env.reset(seed=None if step else SEED)
        if not moment.rewards:
            outcome = outcome[0], 0.0, False, False, outcome[1]
        wanted = (moment.rewards, moment.terminations, moment.truncations)
        assert outcome[1:4] == tuple(each.get("robot_0", False) for each in wanted)
        assert_same(outcome[0], moment.observations["robot_0"])
        assert_same(outcome[4], moment.infos["robot_0"])
        stop_one(0, step, env.parallel) if step == 2 else None
    env.close()


@cases(OPTIONS)
def test_rows_of_a_batch_are_the_robots_of_single_environments(level, backend, name):
    options = options_of(level, backend, name)
    batch = lidarium.vector_env(2, TWO_ROOMS, level=level, threads=1, **options)
    assert batch.num_envs == 2 * batch.batch.robots
    episodes = [alone(level, backend, name, SEED + episode) for episode in range(2)]
    assert assert_rows(batch, episodes, SEED, before=stop_one) >= 2
    batch.close()


@every_backend
@every_level
def test_a_batch_of_one_equals_the_single_environment_by_construction(level, backend):
    options = options_of(level, backend, "plain")
    env = team_of(TWO_ROOMS, level, **options)
    batch = lidarium.vector_env(1, TWO_ROOMS, level=level, **options)
    assert type(env.engine) is type(batch.engine) is Engine
    assert env.engine.episodes == batch.engine.episodes == 1
    assert type(env.engine.level) is type(batch.engine.level)
    assert type(env.simulation) is type(batch.engine.simulation)
    assert_rows(batch, [recorded(env, SEED, STEPS)], SEED)
    assert_same(env.engine.observations, batch.engine.observations)


@cases(OPTIONS)
def test_rows_for_learners_are_those_robots_and_begin_again_in_the_step_that_ends(level, backend, name):
    pytest.importorskip("stable_baselines3")
    options = options_of(level, backend, name)
    rows = lidarium.sb3_vec_env(2, TWO_ROOMS, level=level, threads=1, **options)
    agents, places = rows.settings.agents, [0, 0]
    episodes = [alone(level, backend, name, SEED + episode) for episode in range(2)]
    rows.seed(SEED)
    observations, nothing = rows.reset(), zeros_of(rows.observation_space)
    shown = [moments[0].observations.get(agent, nothing) for moments in episodes for agent in agents]
    while max(places) < STEPS - 1:
        for episode in range(2):
            stop_one(episode, places[episode], rows.batch.team(episode))
        reached = [moments[place + 1] for moments, place in zip(episodes, places, strict=True)]
        observations, rewards, dones, infos = rows.step(actions_of_rows(rows.action_space, reached, agents))
        assert (rewards.dtype, dones.dtype) == (np.float32, bool)
        places = [place + 1 + moment.is_over for place, moment in zip(places, reached, strict=True)]
        for row, info in enumerate(infos):
            episode, agent = row // len(agents), agents[row % len(agents)]
            moment, current = reached[episode], episodes[episode][places[episode]]
            last = moment.observations.get(agent, shown[row])
            shown[row] = current.observations.get(agent, nothing if moment.is_over else last)
            assert_same(of_row(observations, row), shown[row])
            is_cut = moment.truncations.get(agent, moment.is_over)
            assert rewards[row] == np.float32(moment.rewards.get(agent, 0.0))
            assert dones[row] == (moment.terminations.get(agent, False) or is_cut)
            assert info.pop("TimeLimit.truncated") == is_cut
            assert ("terminal_observation" in info) == dones[row]
            if dones[row]:
                assert_same(info.pop("terminal_observation"), last)
            assert ("terminal_state" in info) == moment.is_over
            info.pop("terminal_state", None)
            assert is_active(moment, agent) in (None, info["active"])
            if agent in moment.infos:
                assert_same(without_forms(info), without_forms(moment.infos[agent]))
    rows.close()


# The checker would rather have tables flat, images of bytes and no nested spaces.
@pytest.mark.filterwarnings(
    "ignore:Your observation .* has an unconventional shape",
    "ignore:It seems that your observation .*depth is an image but",
    "ignore:Nested observation spaces are not supported",
)
@pytest.mark.parametrize("name", ALONE)
@every_level
def test_one_robot_passes_the_checker_of_stable_baselines(level, name):
    checker = pytest.importorskip("stable_baselines3.common.env_checker")
    options = {**options_of(level, "kinematic", name), "robots": 1}
    env = gymnasium.make("lidarium/Exploration-v1", floor=TWO_ROOMS, level=level, **options)
    checker.check_env(env, skip_render_check=True)
    env.close()


@every_backend
@every_level
def test_sparse_planning_keeps_the_contract_at_levels_with_goals(level, backend, capsys):
    camera = {"columns": 40, "rows": 30, "pitch": 0.35}
    env = team_of(TWO_ROOMS, level, **{**options_of(level, backend, "plain"), "camera": camera})
    if not issubclass(lidarium.registry("level")[level], lidarium.WaypointLevel):
        with pytest.raises(ValueError, match="want waypoints or frontiers"):
            SparsePlanning(env)
        return
    parallel_api_test(SparsePlanning(env), num_cycles=6)
    assert "Passed" in capsys.readouterr().out
    env.close()


FACES = {
    "parallel": team_of,
    "merged": functools.partial(team_of, merging=MergingSettings()),
    "drawn": functools.partial(team_of, randomize={"reward.time": (0.0, 1.0)}),
    "turn_based": lambda floor, level, **options: lidarium.env(floor, level=level, **options),
    "gymnasium": lambda floor, level, **options: SoloExploration(floor, level, **{**options, "robots": 1}),
    "vector": functools.partial(lidarium.vector_env, 2),
    "learners": functools.partial(lidarium.sb3_vec_env, 2),
}


@pytest.mark.parametrize("face", FACES)
@every_backend
def test_every_face_may_be_closed_twice(face, backend):
    env = made(face, backend)
    env.close()
    env.close()


@pytest.mark.parametrize("face", FACES)
@every_backend
def test_a_closed_face_refuses_a_step(face, backend):
    env = made(face, backend)
    env.reset()
    env.close()
    single = env.action_space
    space = single(env.possible_agents[0]) if callable(single) else single
    action = dict.fromkeys(env.agents, space.sample()) if face in ("parallel", "merged", "drawn") else space.sample()
    for _ in range(SMALL["robots"] - 1 if face == "turn_based" else 0):  # the last agent's action moves all
        env.step(action)
    with pytest.raises(RuntimeError, match="closed; make a new one"):
        env.step(action)


def made(face, backend):
    if face == "learners":
        pytest.importorskip("stable_baselines3")
    return FACES[face](TWO_ROOMS, level="velocity", **options_of("velocity", backend, "plain"))
