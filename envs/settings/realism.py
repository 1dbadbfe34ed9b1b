"""How real the world is, by name."""

from collections.abc import Mapping
from typing import Any

from lidarium.envs.settings.faults import NO_FAULTS, FaultSettings
from lidarium.envs.settings.radio import RadioSettings
from lidarium.registry import Registry

REALISM: Registry[Mapping[str, Any]] = Registry("realism")
"""Presets of realism: each is a set of options of ``make_settings``."""

REALISM.register(
    "ideal",
    {"noise": "none", "odometry": "ideal", "localization": "truth", "radio": "all", "faults": NO_FAULTS},
    "perfect sensors, poses, radio, robots",
)
REALISM.register(
    "lab",
    {
        "noise": "datasheet",
        "odometry": "typical",
        "localization": "slam",
        "radio": "all",
        "faults": NO_FAULTS,
    },
    "noisy sensors with SLAM on board, perfect radio",
)
REALISM.register(
    "field",
    {
        "noise": "datasheet",
        "odometry": "poor",
        "localization": "slam",
        "radio": RadioSettings(kind="signal", shadowing=4.0, loss=0.05, latency_s=0.2),
        "faults": FaultSettings(laser_dropout=6.0, blind_sector=6.0, stuck_wheel=2.0, dead_radio=1.0),
    },
    "noisy sensors, poor wheels, lossy radio, faults",
)
