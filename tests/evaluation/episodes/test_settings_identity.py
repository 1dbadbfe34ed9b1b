"""A preset's name and a hash say which settings a result is of."""

from dataclasses import replace

import pytest

from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.envs.settings.making import REALISM, make_settings
from lidarium.evaluation.episodes.settings_identity import realism_of, settings_sha256


def test_noise_is_not_ideal():
    assert realism_of(make_settings(noise="datasheet")) == "custom"


def test_the_hash_of_settings_tells_all_that_matters_and_threads_do_not():
    assert settings_sha256(ExplorationSettings()) == settings_sha256(ExplorationSettings(threads=4))
    assert settings_sha256(ExplorationSettings()) != settings_sha256(ExplorationSettings(robots=2))


@pytest.mark.parametrize("name", REALISM)
def test_settings_of_a_preset_have_its_name(name):
    assert realism_of(make_settings(realism=name, robots=3)) == name


def test_a_later_setting_changes_the_hash_where_it_is_used():
    plain = make_settings(robots=2)
    changed = replace(plain, least_frontier=plain.least_frontier + 0.1)
    assert settings_sha256(plain) != settings_sha256(changed)


def test_the_mode_of_sparse_maps_changes_the_hash_only_where_it_is_used():
    given = {"camera": "xtion", "observe": ("scan", "depth")}
    plain, other = make_settings(**given), make_settings(**given, sparse_map={"mode": "thesis"})
    assert settings_sha256(plain) == settings_sha256(make_settings(**given, sparse_map={"mode": "default"}))
    assert settings_sha256(plain) != settings_sha256(other)
    assert settings_sha256(make_settings()) == settings_sha256(make_settings(sparse_map={"mode": "thesis"}))
