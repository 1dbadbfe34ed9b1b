"""Settings made from short options, tables of files, assignments of the command line."""

import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import fields, is_dataclass, replace
from typing import Any

from lidarium.envs.settings.exploration import (
    OCCUPANCY,
    OPTIONAL_PARTS,
    PARTS,
    ExplorationSettings,
    localizer_settings,
    with_parts,
)
from lidarium.envs.settings.faults import NO_FAULTS, FaultSettings
from lidarium.envs.settings.lidar import NOISE, Lidar, checked_lidars
from lidarium.envs.settings.limits import LEARNERS_SEE
from lidarium.envs.settings.radio import RadioSettings
from lidarium.mapping.geometry.bounds import Rule, check_values, rules_of, shown, within
from lidarium.mapping.grids.occupancy import OccupancySettings
from lidarium.registry import REGISTRIES, Registry, registry, unknown

REALISM: Registry[Mapping[str, Any]] = Registry("realism")
"""Presets of realism: each is a set of options of ``make_settings``."""

REALISM.register(
    "ideal",
    {
        "noise": "none",
        "odometry": "ideal",
        "localization": "truth",
        "radio": "all",
        "faults": NO_FAULTS,
        "scan_period_s": None,
    },
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
        "scan_period_s": None,
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
        "scan_period_s": None,
    },
    "noisy sensors, poor wheels, lossy radio, faults",
)
REALISM.register(
    "fast",
    {
        **REALISM["ideal"],
        "scan_period_s": 0.4,
        "resolution": 0.1,
        "lidar": {"beams": 182},
    },
    "ideal, with fewer scans of fewer beams and coarser maps, for learners",
)


NOISE_NAMES = ("noise_floor", "noise_share")
"""Settings of a laser's noise."""

CYCLES = Rule(int, bounds=within(1, 10**9))
"""Rule for the number of steps of an episode."""

TIME_STEP = rules_of(ExplorationSettings)["time_step"]

SHORT_OPTIONS = ("assigned", "max_cycles", "noise", "realism", "resolution")
"""Options of ``make_settings`` that are no attributes of the settings."""


MOST_LISTED = 300
"""Longest list of known settings in a message [characters]."""


def make_settings(settings: ExplorationSettings | None = None, **options: Any) -> ExplorationSettings:  # noqa: ANN401
    """Make settings of an environment from the options of `parallel_env`.

    Parameters
    ----------
    settings : ExplorationSettings, optional
        Settings to start from; the defaults if None.
    **options
        Any attribute of `ExplorationSettings`; a part such as ``robot`` or ``reward`` also as a mapping of
        its values, and ``robot``, ``lidar``, ``camera``, ``odometry``, ``radio`` and ``battery`` by name.
        A list as ``lidar`` has the laser of each robot.
        ``noise`` ("none", "datasheet" or "thesis") sets the noise of the laser, ``resolution`` the cell of
        the maps [m], ``max_cycles`` the horizon in steps instead of ``horizon_s``. ``realism`` ("ideal",
        "lab", "field" or "fast") sets noise, odometry, localization, radio, faults and ``scan_period_s`` unless they
        are given; "fast" also the laser and the maps' resolution.
        ``assigned`` sets single values last, as ``["lidar.beams=180"]``.

    Returns
    -------
    ExplorationSettings
        The settings.

    Raises
    ------
    ValueError, TypeError
        If an option is unknown or has a bad value.

    Examples
    --------
    >>> import lidarium
    >>> lidarium.make_settings(robots=3, resolution=0.05, lidar={"beams": 180}).lidar.beams
    180
    """
    base = settings or ExplorationSettings()
    assigned = options.pop("assigned", ())
    realism = options.pop("realism", None)
    is_noise_given = "noise" in options
    _check_resolutions(options)
    if realism is not None:
        implied = dict(REALISM[realism])
        if _has_resolution(options.get("occupancy")):
            implied.pop("resolution", None)
        options = {**implied, **options}
    for name in options:
        _check_kinds(name, options.get("kinds", base.kinds))
    options |= _lasers(options, base, is_noise_given)
    options = {name: _part(name, value) for name, value in options.items()}
    resolution = options.pop("resolution", None)
    if resolution is not None:
        check_values({"resolution": resolution}, OCCUPANCY.bounds, "the maps")
        occupancy = options.get("occupancy", base.occupancy)
        if isinstance(occupancy, OccupancySettings):
            options["occupancy"] = replace(occupancy, resolution=resolution)
    if (max_cycles := options.pop("max_cycles", None)) is not None:
        options["horizon_s"] = _horizon(max_cycles, options, base)
    known = ExplorationSettings.__dataclass_fields__
    for name in options:
        if name not in known:
            # Worded as Python does, too: TorchRL tries options and detects unknown ones by the error text.
            said = unknown("option", name, sorted((*known, *SHORT_OPTIONS)))
            raise TypeError(f"got an unexpected keyword argument {name!r}: {said}")
    if isinstance(options.get("localizer"), Mapping):
        chosen = options.get("localization", base.localization)
        options["localizer"] = localizer_settings(chosen, options["localizer"])
    return assign(replace(base, **options), assigned)


def _check_resolutions(options: Mapping[str, Any]) -> None:
    """Check that the cell of the maps is not given twice."""
    occupancy = options.get("occupancy")
    if options.get("resolution") is not None and isinstance(occupancy, Mapping) and _has_resolution(occupancy):
        raise ValueError(
            f"resolution is {shown(options['resolution'])} and occupancy has a resolution of "
            f"{shown(occupancy['resolution'])}; want one of them"
        )


def _has_resolution(occupancy: Any) -> bool:  # noqa: ANN401
    """Return whether settings of the maps have their cell."""
    return isinstance(occupancy, OccupancySettings) or (isinstance(occupancy, Mapping) and "resolution" in occupancy)


def _check_kinds(name: str, kinds: Any) -> None:  # noqa: ANN401
    """Check that the robot of a team is not set if its kinds make it."""
    if name == "robot" and kinds:
        raise ValueError(f"robot is set, and kinds is {shown(kinds)}; want one of them: the robots are those of kinds")


def makers_settings(settings: ExplorationSettings | None, options: Mapping[str, Any]) -> ExplorationSettings:
    """Fill settings as ``make_settings``, for makers of training environments.

    By default start poses are drawn, and robots observe ``LEARNERS_SEE`` if neither settings nor ``observe`` are given.
    """
    observe = {} if settings is not None or "observe" in options else {"observe": LEARNERS_SEE}
    made = make_settings(settings, **observe, **options)
    return replace(made, starts="drawn") if made.starts is None else made


def _horizon(max_cycles: Any, options: Mapping[str, Any], base: ExplorationSettings) -> float:  # noqa: ANN401
    """Return the horizon [s] of that many steps."""
    if "horizon_s" in options:
        raise ValueError(
            f"max_cycles is {shown(max_cycles)} and horizon_s is {shown(options['horizon_s'])}; want one of "
            "them: both set the horizon"
        )
    time_step = options.get("time_step", base.time_step)
    for name, value, rule in (("max_cycles", max_cycles, CYCLES), ("time_step", time_step, TIME_STEP)):
        if not rule.hold(value):
            raise ValueError(f"{name} is {shown(value)}; want {rule.wanted}")
    return float(max_cycles * time_step)


def _lasers(options: dict[str, Any], base: ExplorationSettings, is_noise_given: bool) -> dict[str, Any]:
    """Take ``lidar``, ``lidars`` and ``noise`` out of the options, and return the settings that they make.

    The noise of a realism, which is not given itself, leaves given lasers alone that state theirs.
    """
    keeps = not is_noise_given and not options.keys().isdisjoint({"lidar", "lidars"})
    lidars = options.pop("lidars", () if "lidar" in options else base.lidars)
    lidar, noise = options.pop("lidar", base.lidar), options.pop("noise", None)
    if isinstance(lidar, list | tuple) and lidar:
        lidar, lidars = base.lidar, lidar
    given = [lidar, *(lidars if isinstance(lidars, list | tuple) else ())]
    lidar, *made = (_part("lidar", each) for each in given)
    lidars = checked_lidars(made if isinstance(lidars, list | tuple) else lidars)
    if noise is not None:
        noise_floor, noise_share = NOISE[noise]
        lidar, *lidars = (
            replace(each, noise_floor=noise_floor, noise_share=noise_share)
            if isinstance(each, Lidar) and not (keeps and _states_noise(stated, each))
            else each
            for each, stated in zip((lidar, *lidars), given, strict=True)
        )
    return {"lidar": lidar, "lidars": lidars}


def _states_noise(given: Any, lidar: Lidar) -> bool:  # noqa: ANN401
    """Return whether a laser was given with its noise: by its values, or as one that is noisy."""
    return lidar.is_noisy or (isinstance(given, Mapping) and not given.keys().isdisjoint(NOISE_NAMES))


def _part(name: str, value: Any) -> Any:  # noqa: ANN401
    """Return the value of an option, if it is a part by its name or by its values."""
    if name in PARTS and isinstance(value, Mapping):
        check_values(value, rules_of(ExplorationSettings)[name].inner, name)
        return with_parts(PARTS[name], value)
    if name in PARTS and name in REGISTRIES and isinstance(value, str):
        return registry(name)[value]
    return value


def assign(settings: ExplorationSettings, assignments: Iterable[str]) -> ExplorationSettings:
    """Return settings with single values set."""
    for assignment in assignments:
        name, equals, text = assignment.partition("=")
        if not equals:
            raise ValueError(f"{shown(assignment)} sets nothing; want NAME=VALUE, such as reward.time=0.02")
        path = name.strip().split(".")
        if path[0] == "localizer" and settings.localizer is None:
            settings = replace(settings, localizer=localizer_settings(settings.localization, {}))
        if path[0] in OPTIONAL_PARTS and len(path) > 1 and getattr(settings, path[0]) is None:
            settings = replace(settings, **{path[0]: PARTS[path[0]]()})
        value = value_of(text.strip())
        if value is None and len(path) == 1 and path[0] in REGISTRIES and "none" in registry(path[0]):
            value = "none"  # the name of a radio or battery
        settings = _replaced(settings, path, value, name.strip())
    return settings


def set_values(settings: ExplorationSettings, values: Mapping[str, Any]) -> ExplorationSettings:
    """Return settings with values set by the names that ``lidarium show settings`` lists."""
    for name, value in values.items():
        settings = _replaced(settings, name.split("."), value, name)
    return settings


def _replaced(part: Any, path: list[str], value: Any, name: str) -> Any:  # noqa: ANN401
    """Return a part with the value at the end of a path replaced."""
    known = [each.name for each in fields(part)] if is_dataclass(part) else []
    if path[0] not in known:
        said = unknown("setting", path[0], known, MOST_LISTED)
        raise ValueError(f"{name!r} is no setting: {said}")
    if isinstance(part, ExplorationSettings):
        _check_kinds(path[0], part.kinds)
    if isinstance(part, ExplorationSettings) and path[0] == "lidar" and len(path) > 1 and part.lidars:
        # The laser of each robot: the one of the team is made from them.
        return make_settings(part, lidar=[_replaced(each, path[1:], value, name) for each in part.lidars])
    if len(path) > 1:
        value = _replaced(getattr(part, path[0]), path[1:], value, name)
    elif isinstance(part, OccupancySettings):
        check_values({path[0]: value}, OCCUPANCY.bounds, "occupancy")
    elif isinstance(part, ExplorationSettings):
        return make_settings(part, **{path[0]: value})
    try:
        return replace(part, **{path[0]: value})
    except TypeError as error:
        raise ValueError(f"{name} cannot be {shown(value)}: {error}") from error


def value_of(text: str) -> Any:  # noqa: ANN401
    """Return the value of a text: as in TOML, ``none`` for None, otherwise the text itself."""
    if text.lower() == "none":
        return None
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except (ValueError, RecursionError) as error:  # text needs no quotes
        if text.startswith(("[", "{")):
            raise ValueError(
                f'{shown(text)} is not a valid TOML list or table; put names in quotes, as in kinds=["kobuki"]'
            ) from error
        return text
