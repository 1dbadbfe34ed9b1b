"""Settings at random, from usual to extreme, and the first steps with them."""

import random
import typing
from typing import Any

import numpy as np

import lidarium
from lidarium.envs.settings.exploration import ExplorationSettings, localizer_settings
from lidarium.envs.settings.making import make_settings
from lidarium.envs.settings.table import settings_table
from lidarium.mapping.geometry.bounds import Bounds, rules_of

STEPS = 3
STEP_S = 5.0
FLOOR = "apartment"
WILD: tuple[Any, ...] = (
    *(0, -1, 1, 2, 3, 1e-308, 1e308, -1e308, 1e18, 1e9, 1e7, 1e300, 10**23, 10**400, float("nan")),
    *(float("inf"), -float("inf"), True, False, None, "", "x", "$", [], {}, [1, 2], (), b"x", object, 3.7),
    *(np.float32(2.0), np.int64(3), np.nan, np.array([1.0, 2.0]), "1", "nan", {"a": 1}, complex(1, 2)),
)
NAMED = {
    "localization": ("truth", "odometry", "slam", "splines", "splines_ekf"),
    "radio.kind": ("all", "none", "range", "line_of_sight", "signal"),
    "robot": ("kobuki", "pioneer", "service", "point"),
    "realism": ("ideal", "lab", "field", "fast"),
    "observe": (["scan", "pose", "egocentric_map"], ["map"], ["egocentric_map"]),
}


def try_settings(chance: random.Random) -> None:
    """Make settings of random values, by the interface or as the command line does, and step with them.

    Raises
    ------
    ValueError, TypeError
        Where they are refused.
    AssertionError
        Where something that is no number was observed.
    """
    chosen = _chosen(chance)
    if chance.random() < 0.4:
        assigned = tuple(f"{name}={value}" for name, value in chosen.items())
        settings = make_settings(assigned=assigned)
    else:
        try:
            settings = make_settings(**_nested(chosen))
        except TypeError as error:
            # What the interface promises for options that it does not have.
            if "unexpected keyword" in str(error) or "unknown option" in str(error):
                raise ValueError(str(error)) from error
            raise
    _step(settings, chance)


def _chosen(chance: random.Random) -> dict[str, Any]:
    """Return a few settings by name: extreme within their bounds, or anything at all."""
    bounds = dict(_all_bounds())
    chosen: dict[str, Any] = {}
    for name in chance.sample(sorted(bounds), chance.choice((1, 2, 4, 8))):
        if chance.random() < 0.3:
            chosen[name] = chance.choice(WILD)
        elif bounds[name] is not None:
            chosen[name] = _extreme(bounds[name], chance)
    for name, values in NAMED.items():
        if chance.random() < 0.25 and not any(other.startswith(f"{name}.") for other in chosen):
            chosen[name] = chance.choice(values)
    localization = chosen.get("localization")
    if localization in NAMED["localization"][2:] and chance.random() < 0.6:
        chosen |= _localizer(localization, chance)
    return chosen


def _localizer(localization: str, chance: random.Random) -> dict[str, Any]:
    settings = localizer_settings(localization, {})
    rows = {row.name: row for row in _rows(settings)}
    chosen = {}
    for name in chance.sample(sorted(rows), 3):
        bounds = rows[name]
        chosen[f"localizer.{name}"] = (
            chance.choice(WILD) if bounds is None or chance.random() < 0.3 else _extreme(bounds, chance)
        )
    return chosen


class _Bounded(typing.NamedTuple):
    """Bounds with the type of what they bound."""

    name: str
    bounds: Bounds
    is_whole: bool


def _rows(settings: Any, prefix: str = "") -> list[_Bounded]:
    rows = []
    for name, rule in rules_of(type(settings)).items():
        value = getattr(settings, name)
        if hasattr(value, "__dataclass_fields__"):
            inner = {part.name.rpartition(".")[2]: part for part in _rows(value, f"{prefix}{name}.")}
            rows += [
                _Bounded(part.name, rule.inner.get(short, part.bounds), part.is_whole) for short, part in inner.items()
            ]
        elif rule.kind in (int, float):
            rows.append(_Bounded(f"{prefix}{name}", rule.bounds, rule.kind is int))
    return rows


def _all_bounds() -> list[tuple[str, _Bounded | None]]:
    known = {row.name: row for row in _rows(ExplorationSettings())}
    return [(row.name, known.get(row.name)) for row in settings_table()]


def _extreme(row: _Bounded, chance: random.Random) -> Any:
    """Return a value at an end of the bounds, or between them by magnitude."""
    low, high = row.bounds.minimum, row.bounds.maximum
    way = chance.random()
    if way < 0.3:
        value = high if chance.random() < 0.7 else high * (1.0 + 1e-9)
    elif way < 0.5:
        value = low if chance.random() < 0.7 else low + 1e-12
    elif way < 0.6:
        value = max(low, 1e-308)
    else:
        span = max(abs(low), abs(high), 1.0)
        value = min(max(span * 10.0 ** chance.uniform(-8.0, 0.0), low), high)
    return round(value) if row.is_whole else value


def _nested(chosen: dict[str, Any]) -> dict[str, Any]:
    """Return settings by the names of their parts as mappings."""
    nested: dict[str, Any] = {}
    for name, value in chosen.items():
        first, _, rest = name.partition(".")
        if not rest:
            nested[first] = value
            continue
        where = nested.setdefault(first, {})
        while "." in rest and isinstance(where, dict):
            part, _, rest = rest.partition(".")
            where = where.setdefault(part, {})
        if isinstance(where, dict):
            where[rest] = value
    return nested


def _step(settings: ExplorationSettings, chance: random.Random) -> None:
    env = lidarium.parallel_env(FLOOR, settings=settings)
    observations, _ = env.reset(seed=chance.randrange(100))
    _check(observations)
    for _ in range(STEPS):
        if not env.agents:
            break
        actions = {agent: np.array([chance.uniform(-1, 1), chance.uniform(-1, 1)], np.float32) for agent in env.agents}
        observations, rewards, *_ = env.step(actions)
        _check(observations)
        assert all(np.isfinite(reward) for reward in rewards.values()), "a reward is no number"


def _check(observations: dict[str, Any]) -> None:
    for observed in observations.values():
        for name, value in observed.items():
            assert np.isfinite(np.asarray(value, np.float64)).all(), f"{name} is not finite"
