"""What of a floor counts, and who has sensed which of it."""

import pickle

import numpy as np

from lidarium.envs.simulation.coverage import pack_bits
from lidarium.envs.simulation.score import Score, counted_cells
from lidarium.mapping.kernels.huge_pages import ArrayPool


def test_a_coarse_cell_counts_only_where_all_its_fine_cells_do():
    free = np.ones((7, 9), bool)
    free[3, 4] = False
    counted = counted_cells(free, 2)
    assert counted.shape == (4, 5)
    assert not counted[1, 2]
    assert counted[0, 0]
    assert not counted[3].any()
    assert not counted[:, 4].any()


def test_cells_that_are_no_coarser_count_as_they_are():
    free = np.random.default_rng(0).random((5, 7)) < 0.5
    assert np.array_equal(counted_cells(free, 1), free)


def test_rewards_and_their_terms_are_parts_of_one_memory_also_of_a_copy():
    for score in (Score(2, 3), pickle.loads(pickle.dumps(Score(2, 3)))):
        score.earned[:] = np.arange(30.0)
        assert score.rewards.tolist() == [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]
        assert score.reward_terms.shape == (6, 4)
        assert score.reward_terms[1].tolist() == [10.0, 11.0, 12.0, 13.0]


def test_an_episode_begins_with_nothing_sensed_and_the_others_keep_theirs():
    score, pages = Score(2, 2), ArrayPool()
    counted = pack_bits(np.ones((3, 70), bool))
    score.seen[:], score.rewards[:] = 5, 1.0
    score.place(1, counted, pages)
    for row in (2, 3):
        score.place_robot(row, pages)
        score.point_at(row)
    assert score.counted.tolist() == [0, 210]
    assert score.seen.tolist() == [5, 5, 0, 0]
    assert score.rewards.tolist() == [1.0, 1.0, 0.0, 0.0]
    assert score.masks[2].shape == counted.shape
    assert score.mask_rows[2, 3:].tolist() == list(counted.shape)
    assert score.mask_rows[2, 1] == score.mask_rows[3, 1] != score.mask_rows[2, 0]


def test_coverage_of_a_floor_on_which_nothing_counts_is_0():
    score = Score(1, 2)
    score.counted[:], score.team_seen[:] = (0, 4), (0, 3)
    assert [score.coverage(episode) for episode in range(2)] == score.coverages().tolist() == [0.0, 0.75]


def test_episodes_on_one_floor_share_what_counts():
    score, free = Score(1, 2), np.ones((6, 6), bool)
    score.counted_masks[1] = score.shared(free, 2, ())
    assert score.shared(free, 2, (1,)) is score.counted_masks[1]
    free[0, 0] = False
    assert score.shared(free, 2, (1,)) is not score.counted_masks[1]
