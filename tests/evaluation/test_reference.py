"""Random episodes against a second, slow and plain scorer."""

import math

import numpy as np
import pytest

import lidarium
from lidarium.envs.floors.catalogue.names import load_floor
from lidarium.envs.floors.floor import Floor, Raster
from lidarium.envs.settings.lidar import Lidar
from lidarium.envs.settings.making import make_settings
from lidarium.evaluation.episodes.history import History
from lidarium.evaluation.episodes.result import result_of
from lidarium.evaluation.episodes.runner import run_episode
from lidarium.evaluation.episodes.watching import WatchedExploration
from tests.evaluation.reference import Notes, Reference

EPISODES = 50
EXACT = {"rel": 0.0, "abs": 1e-9}


def floor_of(solid, side):
    solid[[0, -1]], solid[:, [0, -1]] = 1, 1
    rows, columns = solid.shape
    return Floor(
        "drawn",
        (0.0, 0.0, columns * side, rows * side),
        cells=Raster(solid.astype(np.uint8), (0.0, 0.0), side),
    )


def drawn_floor(generator):
    """A room of 2.4 to 4 m with boxes and a wall with a door."""
    side = 0.1
    rows, columns = (int(generator.integers(24, 40)) for _ in range(2))
    solid = np.zeros((rows, columns))
    wall, door = int(generator.integers(9, columns - 9)), int(generator.integers(2, rows - 9))
    solid[:, wall] = 1
    solid[door : door + 7, wall] = 0
    for _ in range(int(generator.integers(0, 4))):
        i, j = int(generator.integers(1, rows - 4)), int(generator.integers(1, columns - 4))
        solid[i : i + 3, j : j + int(generator.integers(1, 4))] = 1
    return floor_of(solid, side)


def cut_floor(generator, apartment):
    """A piece of 3 to 4 m of the apartment, walls and furniture as they come."""
    rows, columns = (int(generator.integers(60, 80)) for _ in range(2))
    row, column = (
        int(generator.integers(0, size - part))
        for size, part in zip(apartment.solid.shape, (rows, columns), strict=True)
    )
    return floor_of(apartment.solid[row : row + rows, column : column + columns].copy(), apartment.resolution)


def drawn_settings(generator):
    is_round = bool(generator.integers(2))
    beams = int(generator.integers(12, 40))
    is_noisy = bool(generator.integers(2))
    lidar = Lidar(
        beams=beams,
        field_of_view=2.0 * math.pi if is_round else generator.uniform(1.5, 5.0),
        range_max=generator.uniform(0.8, 2.0),
        noise_floor=float(generator.choice([0.01, 0.03])) if is_noisy else 0.0,
        noise_share=0.01 if is_noisy else 0.0,
    )
    return make_settings(
        robots=int(generator.integers(1, 4)),
        lidar=lidar,
        raster_resolution=0.05,
        resolution=float(generator.choice([0.05, 0.1])),
        known_starts=bool(generator.random() < 0.8),
        horizon_s=float(generator.choice([1.0, 3.0, 5.0])),
        stop_coverage=float(generator.choice([0.85, 0.99])),
        decision_period_s=float(generator.choice([0.5, 1.0])),
    )


def drawn_starts(generator, env):
    """Starts as a reset draws them, moved a little off the lattice, on which ties are the rule."""
    starts = env.world.starts.copy()
    starts[:, :2] += generator.uniform(0.2, 0.8, (len(starts), 2)) * 0.02
    starts[:, 2] = generator.uniform(-math.pi, math.pi, len(starts))
    return starts


def drawn_episode(seed):
    """An episode with its history and notes; a floor or starts that have no room for the team are drawn
    anew."""
    generator = np.random.default_rng(seed)
    apartment = load_floor("apartment").raster(0.05, 0.3, 0.3)
    while True:
        floor = cut_floor(generator, apartment) if generator.random() < 0.5 else drawn_floor(generator)
        history, notes = History(), Notes()
        env = WatchedExploration(floor, drawn_settings(generator), watchers=[history, notes])
        policy = lidarium.policy(str(generator.choice(["random_walk", "nearest_frontier"])))
        try:
            env.reset(seed=seed)
            episode = run_episode(policy, env, seed, {"starts": drawn_starts(generator, env)})
        except ValueError:
            continue
        return episode, history, notes


@pytest.mark.parametrize("seed", range(EPISODES))
def test_a_random_episode_has_the_figures_of_the_slow_reference(seed):
    episode, history, notes = drawn_episode(seed)
    env = episode.env
    result, reference = result_of(episode, history=history), Reference(env, notes)
    assert result["coverage_final"] == pytest.approx(reference.coverage[-1], **EXACT)
    assert [result[f"t{share}_s"] for share in (85, 90, 95, 99)] == [
        reference.time_to(share / 100) for share in (85, 90, 95, 99)
    ]
    assert result["auc"] == pytest.approx(reference.auc, **EXACT)
    assert result["overlap"] == pytest.approx(reference.overlap, **EXACT)
    assert result["overlap_mv"] == pytest.approx(reference.instant_overlap, **EXACT)
    assert result["path_m"] == pytest.approx(list(reference.path), **EXACT)
    if env.settings.known_starts:
        # Maps of unknown starts lie on lattices of their own, which the reference does not keep.
        known, own, valid = reference.known_shares
        assert result["iou_occupied"] == pytest.approx(reference.iou, **EXACT)
        assert result["c_known_final"] == pytest.approx(known, **EXACT)
        assert result["c_valid_final"] == pytest.approx(valid, **EXACT)
        assert result["balance"] == pytest.approx(np.std(own), **EXACT)
