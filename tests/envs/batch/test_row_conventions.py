"""Rows of a batch in the forms that trainers want."""

import numpy as np
import pytest
from linked_rooms import TWO_ROOMS

from lidarium.envs.engine.engine import EpisodeBatch
from lidarium.envs.faces.row_conventions import RowConventions
from lidarium.envs.faces.conventions import Conventions
from lidarium.envs.settings.making import make_settings
from lidarium.envs.faces.team_exchange import MergingSettings

OPTIONS = {"robots": 2, "observe": ["pose", "velocity"], "map_cells": 32, "lidar": "lidar_360_6m"}


def begun(level="velocity", merging=None, conventions=None, **options):
    batch = EpisodeBatch(2, TWO_ROOMS, make_settings(**OPTIONS, **options), level)
    forms = RowConventions(batch, Conventions(**(conventions or {})), merging)
    batch.run(None, np.arange(2), [1, 2])
    forms.exchange()
    return batch, forms


def test_without_conventions_all_is_as_the_batch_has_it():
    batch, forms = begun()
    actions = np.zeros((4, 2))
    assert forms.actions(actions) is actions
    assert forms.observations(batch.observations) is batch.observations
    assert forms.infos(batch.infos) is batch.infos
    assert forms.space == batch.observation_space
    assert forms.action_space == batch.action_space
    own = forms.observation(batch.observations, 1)
    batch.observations["pose"][1] = 9.0
    assert not (own["pose"] == 9.0).any()


def test_flat_rows_have_their_keys_in_the_order_of_the_alphabet():
    batch, forms = begun(conventions={"observation": "flat", "infos": "none"})
    assert forms.columns == (("pose", 0, 3), ("velocity", 3, 5))
    rows = forms.observations(batch.observations)
    assert rows.shape == (4, 5)
    assert np.array_equal(rows[:, :3], batch.observations["pose"])
    assert np.array_equal(forms.observation(batch.observations, 3), rows[3])
    assert forms.infos(batch.infos) == {}


def test_the_mask_can_be_in_any_infos():
    for infos in ("full", "flat", "none"):
        batch, forms = begun("frontier", conventions={"action_mask": "infos", "infos": infos})
        assert "action_mask" not in forms.observations(batch.observations)
        found = forms.infos(batch.infos)
        assert np.array_equal(found["action_mask"], batch.observations["action_mask"])
        assert found["_action_mask"].all()
        assert ("state" in found) == (infos == "full")
        assert ("truth.pose.0" in found) == (infos == "flat")


def test_the_share_of_the_team_is_the_mean_of_those_that_acted():
    batch, forms = begun(conventions={"team_reward": 0.5})
    rewards, acted = np.array([1.0, 3.0, 5.0, 0.0]), np.array([True, True, True, False])
    mixed, infos = forms.rewards(rewards, acted, batch.infos)
    assert mixed.tolist() == [1.5, 2.5, 5.0, 0.0]
    assert infos["reward_terms"]["team"].tolist() == [0.5, -0.5, 0.0, 0.0]
    assert "team" not in batch.infos["reward_terms"]
    plain = begun()[1].rewards(rewards, acted, batch.infos)[0]
    assert plain.tolist() == rewards.tolist()
    assert plain is not rewards


def test_messages_are_split_off_and_heard_by_teammates_alone():
    batch, forms = begun(conventions={"comm": 1})
    assert not forms.observations(batch.observations)["messages"].any()
    sent = np.array([[0.1, 0.0, 0.5], [0.0, 0.0, -0.5], [0.0, 0.0, 0.25], [0.0, 0.0, 2.0]])
    actions = forms.actions(sent)
    assert np.array_equal(actions, sent[:, :2])
    batch.run(actions, np.arange(0))
    forms.exchange()
    heard = forms.observations(batch.observations)["messages"]
    assert heard[:, 0, 0].tolist() == [-0.5, 0.5, 1.0, 0.25]
    batch.run(actions, np.array([0]), [9])
    forms.exchange()
    heard = forms.observations(batch.observations)["messages"]
    assert not heard[:2].any()
    assert heard[2:, 0, 0].tolist() == [1.0, 0.25]
    with pytest.raises(ValueError, match=r"messages have shape \(3, 1\); want \(4, 1\)"):
        forms.actions(sent[:3])


def test_merged_maps_are_observed_and_rows_cannot_stay_after_their_end():
    batch, forms = begun(merging=MergingSettings(), known_starts=False)
    added = set(forms.observations(batch.observations)) - set(batch.observations)
    assert {"team_map", "teammates"} <= added
    assert set(forms.space.spaces) == added | set(batch.observations)
    assert "merges" in forms.infos(batch.infos)
    with pytest.raises(ValueError, match="ended_agents is 'zeros'; leave it out"):
        RowConventions(batch, Conventions(ended_agents="zeros"))
