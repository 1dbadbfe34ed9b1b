"""Levels of decision are put around the environment of one team."""

import pytest

import lidarium
from lidarium.envs.levels.frontiers import FrontierExploration
from lidarium.envs.faces.merged_maps import MergedMaps


@pytest.mark.parametrize("wrapper", [FrontierExploration, MergedMaps])
def test_a_batch_in_a_wrapper_of_one_team_is_refused(wrapper):
    batch = lidarium.vector_env(2, "scene_room", robots=2)
    with pytest.raises(ValueError, match=f"{wrapper.__name__} is put around ExplorationVectorEnv, a batch"):
        wrapper(batch)
