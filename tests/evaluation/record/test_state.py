"""The hash of a state is of all that an episode leaves in its world."""

import numpy as np

from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.settings.making import make_settings
from lidarium.evaluation.record.state import state_sha256


def test_the_hash_of_a_state_covers_poses_scans_maps_masks_and_endings():
    env = ExplorationEnv("scene_room", make_settings(robots=1))
    env.reset(seed=0)
    world, hashes = env.world, {state_sha256(env)}
    for change in (
        lambda: world.poses.__setitem__((0, 0), np.nextafter(world.poses[0, 0], 9.0)),
        lambda: world.velocities.__setitem__((0, 1), 1e-300),
        lambda: env.simulation.ranges.__setitem__((0, 5), np.float32(1.0)),
        lambda: env.beliefs.log_odds[0].__setitem__((0, 0), 1),
        lambda: env.score.masks[0].__setitem__((0, 0), np.uint64(1)),
        lambda: env.score.seen.__setitem__(0, 1),
        lambda: env.scorer.ended_because.update(robot_0="stopped"),
    ):
        change()
        hashes.add(state_sha256(env))
    assert len(hashes) == 8


def test_the_same_episode_has_the_same_hash_and_what_is_made_of_a_state_does_not_count():
    hashes = set()
    for observe in (("scan",), ("scan", "pose")):
        env = ExplorationEnv("scene_room", make_settings(robots=1, observe=observe))
        env.reset(seed=0)
        hashes.add(state_sha256(env))
    assert len(hashes) == 1
