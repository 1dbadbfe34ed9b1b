"""Types and bounds of settings, declared in annotations and checked for all sources of values.

A number is declared as ``Annotated[float, within(0.0, 10.0)]``, an optional one as that ``| None``, and a
part whose class declares no bounds as ``Annotated[Part, inner(name=within(...))]``.
"""

import math
import reprlib
import types
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, is_dataclass
from numbers import Integral, Real
from typing import Annotated, Any, Union, get_args, get_origin, get_type_hints

import numpy as np

UNBOUNDED = 1e9
"""Largest magnitude of a number without bounds of its own."""

_MAX_LETTERS = 80
_PLAIN = (int, float, bool, str)


@dataclass(frozen=True, slots=True)
class Bounds:
    """The interval of a number.

    Attributes
    ----------
    minimum, maximum : float
        The ends.
    has_minimum, has_maximum : bool
        Whether the ends themselves are allowed.
    what : str
        Name of such a number in messages.
    never : bool
        Whether infinity is allowed as well, for a limit that can be switched off.
    """

    minimum: float = -UNBOUNDED
    maximum: float = UNBOUNDED
    has_minimum: bool = True
    has_maximum: bool = True
    what: str = "a number"
    never: bool = False

    def hold(self, value: Any) -> bool:  # noqa: ANN401
        """Whether a number is within the bounds."""
        if self.never and value == math.inf:
            return True
        above = value >= self.minimum if self.has_minimum else value > self.minimum
        return bool(above and (value <= self.maximum if self.has_maximum else value < self.maximum))

    @property
    def interval(self) -> str:
        """The bounds as an interval, with a square bracket if the end is allowed."""
        low, high = ("[" if self.has_minimum else "("), ("]" if self.has_maximum else ")")
        return f"{low}{self.minimum:.6g}, {self.maximum:.6g}{high}"

    def __str__(self) -> str:
        if self.has_minimum and self.has_maximum and self.minimum != 0.0:
            return f"from {self.minimum:,.10g} to {self.maximum:,.10g}"
        low = f"of {self.minimum:g} or more" if self.has_minimum else f"above {self.minimum:g}"
        high = f"at most {self.maximum:,.10g}" if self.has_maximum else f"below {self.maximum:,.10g}"
        return f"{low} and {high}{', or inf' if self.never else ''}"


@dataclass(frozen=True, slots=True)
class _Inner:
    """Bounds of the numbers of a part, by name."""

    bounds: Mapping[str, Bounds]


def within(minimum: float, maximum: float, what: str = "a number") -> Bounds:
    """Return bounds whose ends are allowed."""
    return Bounds(minimum, maximum, what=what)


def above(minimum: float, maximum: float, what: str = "a number") -> Bounds:
    """Return bounds whose lower end is not allowed."""
    return Bounds(minimum, maximum, has_minimum=False, what=what)


def share(has_minimum: bool = True, has_maximum: bool = True, what: str = "a share") -> Bounds:
    """Return the bounds of a share, from 0 to 1."""
    return Bounds(0.0, 1.0, has_minimum, has_maximum, what)


def inner(**bounds: Bounds) -> _Inner:
    """Return bounds of the numbers of a part."""
    return _Inner(bounds)


Length = Annotated[float, above(0.0, 1000.0)]
"""A positive length [m]."""
Distance = Annotated[float, within(0.0, 1000.0)]
"""A distance that may be zero [m]."""
Angle = Annotated[float, above(0.0, 2.0 * math.pi)]
"""A positive angle [rad]."""
Turn = Annotated[float, within(0.0, 2.0 * math.pi)]
"""An angle that may be zero [rad]."""
Duration = Annotated[float, within(0.0, 1e7)]
"""A time that may be zero [s]."""
Positive = Annotated[float, above(0.0, 1e6)]
"""A number above zero."""
FromZero = Annotated[float, within(0.0, 1e6)]
"""A number that may be zero."""
Count = Annotated[int, within(1, 1_000_000)]
"""A number of things, at minimum one."""
Counted = Annotated[int, within(0, 1_000_000)]
"""A number of things that may be zero."""


@dataclass(frozen=True, slots=True)
class Rule:
    """The type and bounds of a setting.

    Attributes
    ----------
    kind : type
        ``int``, ``float``, ``bool``, ``str`` or the class of a part; ``object`` if its class checks itself.
    is_optional : bool
        Whether it may be None.
    bounds : Bounds
        Bounds of a number.
    inner : mapping of str to Bounds
        Bounds of the numbers of a part.
    """

    kind: type = object
    is_optional: bool = False
    bounds: Bounds = field(default_factory=Bounds)
    inner: Mapping[str, Bounds] = field(default_factory=dict)

    @property
    def wanted(self) -> str:
        """The type and bounds in words."""
        kinds = {float: self.bounds.what, int: "a whole number", bool: "true or false", str: "text"}
        kind = kinds.get(self.kind, self.kind.__name__)
        bounds = f" {self.bounds}" if self.kind in (int, float) else ""
        return f"{kind}{bounds}{', or None' if self.is_optional else ''}"

    def hold(self, value: Any) -> bool:  # noqa: ANN401
        """Whether a value satisfies the rule."""
        if self.kind is object or (value is None and self.is_optional):
            return True
        if self.kind not in _PLAIN:
            return isinstance(value, self.kind)
        is_logical = isinstance(value, bool | np.bool_)
        if self.kind in (bool, str):
            return is_logical if self.kind is bool else isinstance(value, str)
        number = Integral if self.kind is int else Real
        return isinstance(value, number) and not is_logical and self.bounds.hold(value)


_RULES: dict[Any, dict[str, Rule]] = {}


def rules_of(kind: Any) -> dict[str, Rule]:  # noqa: ANN401
    """Return the rule of each setting of a class, by its annotations."""
    if kind not in _RULES:
        hints = get_type_hints(kind, include_extras=True)
        _RULES[kind] = {each.name: _rule(hints[each.name]) for each in fields(kind)}
    return _RULES[kind]


def check_settings(settings: Any, whose: str = "") -> None:  # noqa: ANN401
    """Check the types and bounds of all settings of a dataclass.

    ``whose`` names it in messages, such as ``the robot``. Raises ValueError if a setting has another type or is out
    of bounds; the message names it, its value and the rule.
    """
    of = f" of {whose}" if whose else ""
    kind: Any = type(settings)
    for name, rule in rules_of(kind).items():
        value = getattr(settings, name)
        if not rule.hold(value):
            raise ValueError(f"{name}{of} is {shown(value)}; want {rule.wanted}")
        found = {part: getattr(value, part) for part in rule.inner if hasattr(value, part)}
        check_values(found, rule.inner, name)


def check_values(values: Mapping[str, Any], bounds: Mapping[str, Bounds], whose: str) -> None:
    """Check those of the named numbers that have bounds.

    Raises ValueError if one is no number or out of bounds.
    """
    for name, value in values.items():
        rule = Rule(float, False, bounds.get(name, Bounds()))
        if name in bounds and not rule.hold(value):
            raise ValueError(f"{name} of {whose} is {shown(value)}; want {rule.wanted}")


def check_anything(settings: Any, whose: str) -> None:  # noqa: ANN401
    """Check settings of a class that may declare no bounds, and those of its parts.

    By default, numbers must have their type and be within `UNBOUNDED`.
    """
    check_settings(settings, whose)
    for each in fields(settings):
        part = getattr(settings, each.name)
        if hasattr(part, "__dataclass_fields__"):
            check_anything(part, f"{each.name} of {whose}")


def shown(value: Any) -> str:  # noqa: ANN401
    """Return a value for a message, at most one line long."""
    try:
        text = str(value) if isinstance(value, Real) else " ".join(reprlib.repr(value).split())
    except (ValueError, RecursionError):
        return f"a {type(value).__name__} too long to be shown"
    return text if len(text) <= _MAX_LETTERS else f"{text[:_MAX_LETTERS]}..."


def _rule(hint: Any) -> Rule:  # noqa: ANN401
    if get_origin(hint) is Annotated:
        kind, *extras = get_args(hint)
        plain = _rule(kind)
        bounds = next((extra for extra in extras if isinstance(extra, Bounds)), plain.bounds)
        parts = next((extra.bounds for extra in extras if isinstance(extra, _Inner)), {})
        return Rule(plain.kind, plain.is_optional, bounds, parts)
    if get_origin(hint) in (Union, types.UnionType):
        kinds = [each for each in get_args(hint) if each is not type(None)]
        rule = _rule(kinds[0]) if len(kinds) == 1 else Rule()
        return Rule(rule.kind, len(kinds) < len(get_args(hint)), rule.bounds, rule.inner)
    return Rule(hint) if hint in _PLAIN or is_dataclass(hint) else Rule()
