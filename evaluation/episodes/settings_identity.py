"""Identity of settings in results: a preset's name, and a hash."""

import hashlib
import json
from dataclasses import asdict

from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.envs.settings.making import REALISM, make_settings


def realism_of(settings: ExplorationSettings) -> str:
    """Return the name of the preset of realism that the settings are of.

    It is ``custom`` if they are of none.
    """
    for name in REALISM:
        try:
            made = make_settings(settings, realism=name)
        except ValueError:  # settings of a localizer do not go with true poses, for example
            continue
        if made == settings:
            return name
    return "custom"


LATER = (
    "kinds",
    "lidars",
    "localizer",
    "camera",
    "starts",
    "frontiers",
    "least_frontier",
    "frontiers_by_size",
    "graph",
    "state_cells",
    "pyramid_cells",
    "pyramid_levels",
    "scan_period_s",
    "people",
    "doors",
)
"""Settings that older records do not have."""


def settings_sha256(settings: ExplorationSettings, has_observe: bool = False) -> str:
    """Return a hash of the world that settings describe: of all that can change a result except the policy.

    It is of their JSON with sorted keys, without ``threads``, without settings that older records do not have if it is
    not used (`LATER` settings at their defaults, more rewards, the build of robots without forces, sparse maps of
    robots without cameras or their default mode), and with the default of ``observe``: policies may see different
    things in one world. Hashes before 0.3 have ``has_observe``.
    """
    values, plain = asdict(settings), ExplorationSettings()
    del values["threads"]
    if not has_observe:
        values["observe"] = plain.observe
    if values["camera"] is None:
        del values["sparse_map"]
    elif settings.sparse_map.mode == plain.sparse_map.mode:
        del values["sparse_map"]["mode"]
    for name in LATER:
        if name in values and getattr(settings, name) == getattr(plain, name):
            del values[name]
    if not values["reward"]["more"]:
        del values["reward"]["more"]
    if values["backend"] == "kinematic":
        del values["robot"]["build"]
    return hashlib.sha256(json.dumps(values, sort_keys=True, separators=(",", ":")).encode()).hexdigest()
