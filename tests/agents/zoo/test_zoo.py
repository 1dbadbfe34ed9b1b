"""Teams of the zoo: networks with attention to frontiers and teammates, run by numpy."""

import numpy as np
import pytest

import lidarium
from lidarium.agents.zoo.network import FrontierNetwork, network_shapes
from lidarium.agents.zoo.policy import zoo_files
from lidarium.evaluation.suites.starts import starts_in
from lidarium.scripts.main import main

NAMES = {
    "zoo:tours-2": "tour",
    "zoo:ppo-2": "frontier",
    "zoo:ppo-4": "frontier",
    "zoo:mappo-2": "frontier",
    "zoo:mappo-4": "frontier",
    "zoo:signal-2": "frontier",
}


@pytest.fixture(scope="module")
def network():
    """A network whose weights are drawn."""
    generator = np.random.default_rng(0)
    drawn = {name: generator.normal(0.0, 0.3, shape) for name, shape in network_shapes("frontier").items()}
    return FrontierNetwork({name: array.astype(np.float32) for name, array in drawn.items()})


def observation(count=5, places=8, teammates=3, seed=1):
    """Return an observation with some frontiers on offer, the last of the teammates unknown."""
    generator = np.random.default_rng(seed)
    frontiers, gains = np.zeros((places, 4), np.float32), np.zeros(places, np.float32)
    frontiers[:count] = generator.uniform(0.5, 9.0, (count, 4))
    gains[:count] = generator.uniform(0.0, 20.0, count)
    mask = np.zeros(places + 1, np.int8)
    mask[:count] = mask[-1] = 1
    others = generator.uniform(-3.0, 3.0, (teammates, 8)).astype(np.float32)
    others[:, -1] = 1.0
    others[-1] = 0.0
    return {"frontiers": frontiers, "frontier_gains": gains, "teammates": others, "action_mask": mask}


def test_the_order_of_frontiers_and_teammates_changes_nothing_but_the_order(network):
    seen = observation()
    order = np.array([3, 0, 4, 2, 1])
    turned = {name: array.copy() for name, array in seen.items()}
    for name in ("frontiers", "frontier_gains"):
        turned[name][:5] = seen[name][order]
    turned["teammates"] = seen["teammates"][::-1]
    found, again = network.preferences(seen), network.preferences(turned)
    np.testing.assert_allclose(again[:5], found[order], rtol=1e-4, atol=1e-4)
    np.testing.assert_allclose(again[-1], found[-1], rtol=1e-4, atol=1e-4)


def test_places_that_nothing_is_offered_in_change_nothing(network):
    seen, wide = observation(places=8), observation(places=40)
    found, again = network.preferences(seen), network.preferences(wide)
    np.testing.assert_array_equal(np.append(found[:5], found[-1]), np.append(again[:5], again[-1]))


def test_unknown_teammates_are_not_seen_and_known_ones_are(network):
    seen = observation()
    fewer = {**seen, "teammates": seen["teammates"][:2]}
    np.testing.assert_array_equal(network.preferences(fewer), network.preferences(seen))
    none = {**seen, "teammates": seen["teammates"][2:]}
    assert not np.allclose(network.preferences(none), network.preferences(seen))


@pytest.mark.parametrize("count", range(9))
def test_masked_actions_are_never_taken(network, count):
    """With no frontier on offer the robot stays."""
    for seed in range(20):
        seen = observation(count, seed=seed)
        for forbidden in range(count):
            seen["action_mask"][forbidden] = 0
            assert seen["action_mask"][network.choose(seen)]
    assert network.choose(observation(0)) == 8


@pytest.mark.parametrize(("name", "level"), NAMES.items())
def test_what_ships_is_small_and_begins_from_its_card(name, level):
    assert lidarium.policy(name).level == level
    weights = zoo_files(name.partition(":")[2], level).load()
    assert sum(array.nbytes for array in weights.values()) < 400_000
    assert all((array == array.astype(np.float16)).all() for array in weights.values())  # files hold half precision
    assert {key: array.shape for key, array in weights.items()} == network_shapes(level)


def test_a_team_in_a_batch_does_as_alone():
    options = {
        "level": "frontier",
        "robots": 2,
        "horizon_s": 20.0,
        "observe": ["frontiers", "frontier_gains", "teammates"],
    }
    floors = ["apartment:7", "apartment:8", "apartment:7"]
    batch = lidarium.vector_env(3, floors[0], copy=False, **options)
    batch.reset(seed=[0, 1, 2], options={"floor": floors})
    policies = [lidarium.policy("zoo:ppo-2") for _ in floors]
    for episode, policy in enumerate(policies):
        policy.reset(batch.team(episode))
    alone = lidarium.parallel_env("apartment:8", **options)
    policy = lidarium.policy("zoo:ppo-2")
    seen, _ = alone.reset(seed=1)
    policy.reset(alone)
    for _ in range(5):
        chosen = policy.act(seen)
        together = [each.act(batch.team(k).observations) for k, each in enumerate(policies)]
        assert together[1] == chosen
        batch.step(together)
        seen = alone.step(chosen)[0]
    batch.close()
    alone.close()


def test_weights_of_another_network_are_refused(tmp_path):
    path = tmp_path / "weights.safetensors"
    zoo_files("ppo-2").save(path, zoo_files("ppo-2").load())
    assert lidarium.policy("zoo:ppo-2", weights=path).level == "frontier"
    path.write_bytes(path.read_bytes()[:200])
    with pytest.raises(ValueError, match=r"weights\.safetensors is no file of weights"):
        lidarium.policy("zoo:ppo-2", weights=path)


def test_a_team_of_one_is_refused(tmp_path, capsys):
    arguments = ["run", "--policy", "zoo:ppo-2", "--robots", "1", "--out", str(tmp_path / "run")]
    assert main(arguments) == 2
    assert "policy zoo:ppo-2 wants two robots or more; robots is 1" in capsys.readouterr().err
    assert not (tmp_path / "run").exists()


def test_commands_run_a_team_at_its_level(tmp_path, capsys):
    arguments = ["--policy", "zoo:ppo-2", "--floor", "apartment:7", "--robots", "2", "--set", "horizon_s=6"]
    assert main(["run", *arguments, "--out", str(tmp_path / "run")]) == 0
    rows = lidarium.evaluate("zoo:ppo-2", floors="apartment:7", robots=2, seeds=1, settings={"horizon_s": 6.0})
    assert rows[0]["coverage_final"] > 0.0
    capsys.readouterr()


def test_starts_of_a_reset_are_known_whatever_is_observed():
    plain = lidarium.make_settings(robots=2)
    shown = lidarium.make_settings(robots=2, observe=["frontier_gains", "teammates"])
    assert starts_in("apartment:7", shown, 3) == starts_in("apartment:7", plain, 3)


@pytest.mark.parametrize("form", [{"observation": "flat"}, {"action_mask": "beside"}, {"action_mask": "infos"}])
def test_forms_of_observations_that_it_does_not_read_are_refused(form):
    options = {"level": "frontier", "robots": 2, "observe": ["frontier_gains", "teammates"], **form}
    ((name, value),) = form.items()
    words = rf"zoo:ppo-2 reads .*, and {name} is '{value}'; want {name}='"
    env, batch = lidarium.parallel_env("scene_room", **options), lidarium.vector_env(1, "scene_room", **options)
    env.reset(seed=0)
    batch.reset(seed=0)
    for team in (env, batch.team(0)):
        with pytest.raises(ValueError, match=words):
            lidarium.policy("zoo:ppo-2").reset(team)
        lidarium.policy("nearest_frontier_own_map").reset(team)  # it reads beliefs
