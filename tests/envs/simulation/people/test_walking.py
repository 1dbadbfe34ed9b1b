"""People walk without touching walls, each other and robots, the same in every form of a run."""

import copy
import math

import numpy as np
import pytest
from scipy import ndimage

from lidarium.envs.engine.engine import Engine
from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.levels.level import STEPS
from lidarium.envs.settings.making import make_settings
from lidarium.envs.simulation.backends import kinematic_world
from lidarium.envs.simulation.kernels.arrays import (
    BY_PERSON,
    BY_ROBOT,
    CLOSEST,
    NEAR_M,
    NEAR_MISSES,
    NEAR_STEPS,
    PERSON_GAP,
    WALKER_DRAWS,
    WALKER_RADIUS,
    WALKER_SPEED,
    WALKER_VX,
    WALKER_VY,
    WALKER_X,
    WALKER_Y,
)

TOLERANCE = 1e-6
"""How deep a body may reach into another one [m]."""


def walked(floor="office:1", people=8, seed=1, steps=300, robots=2, drive=(0.0, 0.0), **options):
    """People and poses of robots after each step, (steps, people, 11) and (steps, robots, 3), and the environment."""
    settings = make_settings(
        robots=robots, people=people, horizon_s=None, stop_coverage=None, starts="drawn", **options
    )
    env = ExplorationEnv(floor, settings)
    env.reset(seed=seed)
    generator = np.random.default_rng(seed)
    people_then, poses = [], []
    for step in range(steps):
        if step % 10 == 0:
            speeds = generator.uniform((drive[0], -drive[1]), (drive[0] + 1e-9, drive[1] + 1e-9), (robots, 2))
        env.step(dict(zip(env.agents, speeds.astype(np.float32), strict=True)))
        people_then.append(env.simulation.population.people_of(0).copy())
        poses.append(env.world.poses.copy())
    return np.array(people_then), np.array(poses), env


def gaps_to_robots(people, poses, radius):
    apart = people[:, :, None, [WALKER_X, WALKER_Y]] - poses[:, None, :, :2]
    return np.hypot(*np.moveaxis(apart, -1, 0)) - people[:, :, None, WALKER_RADIUS] - radius


def test_people_touch_neither_walls_nor_each_other_nor_robots():
    people, poses, env = walked(people=14, drive=(0.3, 1.0))
    apart = people[:, :, None, [WALKER_X, WALKER_Y]] - people[:, None, :, [WALKER_X, WALKER_Y]]
    gaps = np.hypot(*np.moveaxis(apart, -1, 0)) - people[:, :, None, WALKER_RADIUS] - people[:, None, :, WALKER_RADIUS]
    gaps[:, np.arange(14), np.arange(14)] = np.inf
    assert gaps.min() > -TOLERANCE
    assert gaps_to_robots(people, poses, 0.18).min() > -TOLERANCE
    tables = env.world.floors[0]
    raster = tables.floor.raster(tables.body.resolution, 0.05, 1.7)
    rows, columns = np.nonzero(raster.solid & (ndimage.distance_transform_cdt(raster.solid) <= 1))
    low = np.stack([columns, rows], axis=1) * raster.resolution + np.array(raster.origin)
    for walkers in people[::10]:
        for x, y, radius in walkers[:, [WALKER_X, WALKER_Y, WALKER_RADIUS]]:
            gap = np.maximum(np.maximum(low - (x, y), (x, y) - low - raster.resolution), 0.0)
            assert np.hypot(*gap.T).min() - radius > -TOLERANCE


def test_people_walk_at_the_speeds_of_pedestrians_from_place_to_place():
    people, _, _ = walked(steps=600)
    radii, speeds = people[0, :, WALKER_RADIUS], people[0, :, WALKER_SPEED]
    assert ((radii >= 0.25) & (radii <= 0.3)).all()
    assert ((speeds >= 0.7) & (speeds <= 1.9)).all()
    moved = np.hypot(people[:, :, WALKER_VX], people[:, :, WALKER_VY])
    assert (moved <= 2.0 * speeds + TOLERANCE).all()
    # Who has room walks at the own speed.
    shares = (moved / speeds)[moved > 0.1]
    assert np.quantile(shares, 0.75) == pytest.approx(1.0, abs=1e-6)
    assert (people[-1, :, WALKER_DRAWS] >= 1.0).all()


def test_a_seed_gives_the_same_people_to_the_bit_and_another_seed_others():
    first, second, other = (walked(seed=seed, steps=50)[0] for seed in (4, 4, 5))
    assert first.tobytes() == second.tobytes()
    assert not np.array_equal(first[0], other[0])


def test_a_copy_of_an_environment_goes_on_in_the_same_way():
    _, _, env = walked(steps=20)
    twin = copy.deepcopy(env)
    for each in (env, twin):
        each.step(dict.fromkeys(each.agents, np.zeros(2, np.float32)))
    assert env.simulation.population.walkers.tobytes() == twin.simulation.population.walkers.tobytes()
    assert env.simulation.population.walkers is not twin.simulation.population.walkers
    assert env.simulation.ranges.tobytes() == twin.simulation.ranges.tobytes()


@pytest.mark.parametrize("doors", [0.0, 0.6])
def test_a_batch_has_the_people_of_single_episodes_to_the_bit(doors):
    options = {"robots": 2, "people": 5, "doors": doors, "horizon_s": 20.0, "starts": "drawn", "resolution": 0.05}
    engine = Engine(3, "office:2", make_settings(**options))
    engine.run(None, np.arange(3), [7, 8, 9])
    commands = np.tile((0.3, 0.2), (6, 1))
    for _ in range(40):
        engine.run_kernel(np.full(3, STEPS, np.int8), commands, engine.everyone)
    for episode, seed in enumerate((7, 8, 9)):
        alone = Engine(1, "office:2", make_settings(**options))
        alone.run(None, np.arange(1), [seed])
        for _ in range(40):
            alone.run_kernel(np.full(1, STEPS, np.int8), commands[:2], alone.everyone)
        population, ours = alone.simulation.population, engine.simulation.population
        assert population.people_of(0).tobytes() == ours.people_of(episode).tobytes()
        assert population.doors_of(0).tobytes() == ours.doors_of(episode).tobytes()
        assert population.safety.tobytes() == ours.safety[2 * episode : 2 * episode + 2].tobytes()
        assert alone.simulation.ranges.tobytes() == engine.simulation.ranges[2 * episode : 2 * episode + 2].tobytes()


def test_stages_run_one_by_one_have_the_same_people():
    _, _, env = walked(steps=0, doors=0.5)
    start = env.engine.starts[0]
    staged = kinematic_world(env.settings)
    staged.place(0, start.tables, start.starts, np.ones((1, 1), np.bool_), start.seed)
    commands = np.full((2, 2), (0.2, 0.4))
    staged.steps[0] = 0
    for _ in range(30):
        staged.move_and_sense(commands)
        staged.steps += 1
        env.simulation.step(commands)
    assert staged.population.walkers.tobytes() == env.simulation.population.walkers.tobytes()
    assert staged.true_ranges.tobytes() == env.simulation.ranges.tobytes()


def test_approaches_and_contacts_of_robots_are_those_of_a_slow_definition():
    counted, slow = [], []
    for seed in range(6):
        people, poses, env = walked(
            "apartment", people=6, seed=seed, steps=400, robots=3, drive=(1.0, 1.0), robot="pioneer"
        )
        gaps = gaps_to_robots(people, poses, env.settings.robot.radius).min(axis=1)
        is_near = gaps < NEAR_M
        began = is_near & ~np.vstack([np.zeros((1, 3), np.bool_), is_near[:-1]])
        safety = env.simulation.safety
        assert safety[:, CLOSEST] == pytest.approx(gaps.min(axis=0), abs=1e-12)
        assert safety[:, NEAR_STEPS].tolist() == is_near.sum(axis=0).tolist()
        assert safety[:, NEAR_MISSES].tolist() == began.sum(axis=0).tolist()
        # A robot that drives into a person is left a hair away, unless it slides off within the step.
        touches = gaps < 1e-8
        begins = touches & ~np.vstack([np.zeros((1, 3), np.bool_), touches[:-1]])
        counted += safety[:, BY_ROBOT].tolist()
        slow += begins.sum(axis=0).tolist()
        assert (safety[:, BY_ROBOT] <= env.world.collisions).all()
    assert sum(slow) > 5
    assert sum(counted) == pytest.approx(sum(slow), rel=0.15)
    assert np.abs(np.subtract(counted, slow)).max() <= 1


def test_a_person_who_cannot_stop_walks_into_a_robot_which_is_the_persons_contact():
    _, _, env = walked(people=1, steps=0, robots=1)
    walker, pose = env.simulation.population.people_of(0)[0], env.world.poses[0]
    walker[WALKER_X], walker[WALKER_Y] = pose[0] + math.cos(pose[2]) * 0.5, pose[1] + math.sin(pose[2]) * 0.5
    walker[WALKER_VX], walker[WALKER_VY] = -1.5 * math.cos(pose[2]), -1.5 * math.sin(pose[2])
    env.step({env.agents[0]: np.zeros(2, np.float32)})
    assert env.simulation.safety[0, [BY_ROBOT, BY_PERSON]].tolist() == [0.0, 1.0]
    assert gaps_to_robots(walker[None, None], pose[None, None], 0.18).min() > -TOLERANCE


def test_the_laser_sees_a_person_as_a_disc():
    _, _, env = walked(people=1, steps=0, robots=1, lidar="lidar_360_6m")
    walker, pose = env.simulation.population.people_of(0)[0], env.world.poses[0]
    walker[WALKER_X], walker[WALKER_Y] = pose[0] + 1.0 * math.cos(pose[2]), pose[1] + 1.0 * math.sin(pose[2])
    env.simulation.step(np.zeros((1, 2)), moves_bodies=False)
    ahead = int(np.argmin(np.abs(env.settings.lidar.angles)))
    assert env.simulation.ranges[0, ahead] == pytest.approx(1.0 - walker[WALKER_RADIUS], abs=0.01)
    assert env.simulation.safety[0, PERSON_GAP] == pytest.approx(1.0 - walker[WALKER_RADIUS] - 0.18, abs=1e-9)
