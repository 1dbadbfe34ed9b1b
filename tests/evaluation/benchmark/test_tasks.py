"""Tasks of benchmarks, and their environments."""

import gymnasium
import pettingzoo
import pytest

import lidarium
from lidarium.envs.floors.catalogue.names import load_floor
from lidarium.evaluation.benchmark.tasks import benchmark, benchmark_names

TASKS = benchmark("lidarium-1").tasks


@pytest.mark.parametrize("task", TASKS.values(), ids=list(TASKS))
def test_settings_of_a_task_are_those_that_were_frozen(task):
    assert task.hashes is not None
    first = task.measured_on(task.floors[:2])
    assert first.settings == task.hashes.settings
    assert first.floors == task.hashes.floors[:2]
    assert first.starts == task.hashes.starts[:2]
    assert len(task.hashes.floors) == len(task.hashes.starts) == len(task.floors)


@pytest.mark.parametrize("collection", ["home", "dungeon", "robot_map"])
def test_real_floors_that_ship_are_those_that_were_frozen(collection):
    frozen = {
        floor: found for task in TASKS.values() for floor, found in zip(task.floors, task.hashes.floors, strict=True)
    }
    own = {floor: found for floor, found in frozen.items() if floor.split(":")[0] == collection}
    assert set(own) <= set(lidarium.floor_set(collection))
    assert len(own) >= 11
    for floor, found in own.items():
        assert load_floor(floor).sha256.startswith(found)


def test_there_are_twelve_tasks_with_an_easy_and_a_full_size():
    assert benchmark_names() == ("lidarium-1",)
    assert len(TASKS) == 12
    for task in TASKS.values():
        assert 6 <= task.easy <= len(task.floors)
        assert task.floors_of("easy") == task.floors[: task.easy]
        assert task.baseline in task.policies


@pytest.mark.parametrize("task", TASKS.values(), ids=list(TASKS))
def test_each_task_is_known_by_its_id(task):
    if task.robots == 1:
        assert task.id in gymnasium.registry
    if hasattr(pettingzoo, "make"):
        env = pettingzoo.make("parallel", task.id, level="waypoint", map_cells=32, observe=["map"])
        assert len(env.possible_agents) == task.robots
        env.close()


def test_a_task_is_an_environment_that_draws_its_floors():
    env = gymnasium.make("lidarium/Dungeons-1-v1", level="waypoint", map_cells=32)
    seen = {env.reset(seed=seed)[1].get("floor", env.unwrapped.parallel.floor.name) for seed in range(4)}
    assert len(seen) > 1
    assert seen <= set(lidarium.floor_set("dungeon"))
    assert env.unwrapped.parallel.settings.lidar.range_max == 10.0


def test_an_unknown_task_is_answered_with_the_nearest_one():
    assert benchmark("lidarium-1").task("lidarium/Homes-2-v1").name == "Homes-2"
    with pytest.raises(ValueError, match="lidarium-1 has no task 'Home-2', did you mean 'Homes-2'"):
        benchmark("lidarium-1").task("Home-2")
    with pytest.raises(ValueError, match="no benchmark 'lidarium-9'; there are lidarium-1"):
        benchmark("lidarium-9")
