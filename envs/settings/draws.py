"""Distributions of settings, of which each episode draws its values (domain randomisation)."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.envs.settings.making import set_values
from lidarium.mapping.geometry.bounds import rules_of, shown

Distribution = Callable[[np.random.Generator], Any] | tuple[float, float] | list[Any]
"""Distribution of a setting: a callable of a generator; (low, high) for a uniform one; a list of equally likely
values."""

Distributions = Mapping[str, Distribution]
"""Distributions by the names of settings, such as ``lidar.noise_floor``."""

ROBOTS = "robots"
"""The setting by which teams differ in size."""


class Draws:
    """The draws of settings.

    Parameters
    ----------
    settings : ExplorationSettings
        The settings that are not drawn.
    distributions : mapping
        From names of settings to `Distribution`.

    Raises
    ------
    ValueError
        If the mapping is empty, or a value is not a `Distribution`.
    """

    def __init__(self, settings: ExplorationSettings, distributions: Any) -> None:  # noqa: ANN401
        if not isinstance(distributions, Mapping) or not distributions:
            raise ValueError(
                f"randomize is {shown(distributions)}; want a dict from names of settings to distributions, such "
                'as {"lidar.noise_floor": (0.0, 0.05)}'
            )
        for name, each in distributions.items():
            is_range = isinstance(each, tuple) and len(each) == 2 and _are_numbers(each) and each[0] <= each[1]
            if not (callable(each) or is_range or (isinstance(each, list) and each)):
                raise ValueError(
                    f"the distribution of {name} is {shown(each)}; want (low, high), a list to choose from, or a "
                    "callable of a generator"
                )
        self._settings = settings
        self._distributions: Distributions = dict(distributions)

    @property
    def sizes(self) -> tuple[int, int] | None:
        """The smallest and the largest number of robots that are drawn; None if the size of teams is not drawn.

        Raises
        ------
        ValueError
            If the distribution is a callable, or has values that are not whole numbers of 1 or more.
        """
        sizes = self._distributions.get(ROBOTS)
        if sizes is None:
            return None
        if isinstance(sizes, tuple | list) and all(_is_size(each) for each in sizes):
            return int(min(sizes)), int(max(sizes))
        raise ValueError(
            f"the distribution of robots is {shown(sizes)}; want (least, most) or a list of whole "
            "numbers of 1 or more, so that the largest team is known"
        )

    def draw(self, generator: np.random.Generator) -> dict[str, Any]:
        """Return a value for each setting that is drawn, by name."""
        return {name: self._value(name, each, generator) for name, each in self._distributions.items()}

    def _value(self, name: str, distribution: Distribution, generator: np.random.Generator) -> Any:  # noqa: ANN401
        """Return a value; between the ends of a setting that is a whole number it is one, both ends included."""
        if isinstance(distribution, list):
            return distribution[int(generator.integers(len(distribution)))]
        if isinstance(distribution, tuple):
            low, high = distribution
            kind, is_whole = _kind_of(self._settings, name), isinstance(low, int) and isinstance(high, int)
            if kind is int or (kind is not float and is_whole):
                return int(generator.integers(int(low), int(high) + 1))
            return float(generator.uniform(low, high))
        return distribution(generator)

    def settings_of(self, drawn: Mapping[str, Any]) -> ExplorationSettings:
        """Return the settings with values that were drawn."""
        return set_values(self._settings, drawn)

    def smallest(self, make: Callable[[ExplorationSettings, int], Any], drawn: Mapping[str, Any]) -> None:
        """Check that an environment of the smallest team can be made, before one is drawn.

        Raises
        ------
        ValueError
            If it cannot.
        """
        if self.sizes is None:
            return
        try:
            made = make(self.settings_of({**drawn, ROBOTS: self.sizes[0]}), 0)
        except ValueError as error:
            raise ValueError(f"teams of {self.sizes[0]} to {self.sizes[1]} robots are drawn: {error}") from error
        made.close()


def _kind_of(settings: Any, name: str) -> type:  # noqa: ANN401
    """Return the type of a setting by its dotted name; ``object`` if there is none, which is found out as it is set."""
    first, _, rest = name.partition(".")
    if not is_dataclass(settings) or first not in {each.name for each in fields(settings)}:
        return object
    return _kind_of(getattr(settings, first), rest) if rest else rules_of(type(settings))[first].kind


def _is_size(value: Any) -> bool:  # noqa: ANN401
    return isinstance(value, int) and not isinstance(value, bool) and value >= 1


def _are_numbers(values: Sequence[Any]) -> bool:
    return all(
        isinstance(value, int | float) and not isinstance(value, bool) and np.isfinite(value) for value in values
    )
