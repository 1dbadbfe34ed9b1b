"""Predictors by name: what guesses the unknown part of a map."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.geometry.bounds import shown
from lidarium.mapping.prediction.levels import FREE, OCCUPIED
from lidarium.registry import Registry


@dataclass(frozen=True, slots=True)
class PartialMap:
    """A map of which a part is known, in squares.

    Attributes
    ----------
    levels : (rows, columns) int8
        -1 free, 0 unknown, 1 occupied; row 0 has the lowest y.
    side : float
        Side of a square [m].
    agent : str
        Name of the robot whose map it is; empty for a map of nobody.
    """

    levels: NDArray[np.int8]
    side: float
    agent: str = ""


class Predictor(Protocol):
    """Predicts which unknown squares of partial maps are free.

    It may also have a method ``reset(team)``, which is called at the start of each episode.
    """

    def predict(self, partial: PartialMap) -> NDArray[np.float32] | None:
        """Return the probability that each square is free, (rows, columns) float32, None for no prediction.

        Entries of known squares are ignored.
        """
        ...


class Nothing:
    """Predicts nothing."""

    def predict(self, partial: PartialMap) -> None:
        """Return None."""


PREDICTORS: Registry[Callable[..., Predictor]] = Registry("predictor")
"""Factories of predictors by name; keyword arguments are their settings."""

PREDICTORS.register(
    "network",
    "lidarium.mapping.prediction.network_predictor:NetworkPredictor",
    "a network that was trained on maps of robots in buildings and dungeons",
)
PREDICTORS.register("nothing", Nothing, "no prediction: policies plan on what is known")
PREDICTORS.register(
    "truth",
    "lidarium.evaluation.truth.floor_predictor:FloorPredictor",
    "the floor itself, as a bound on what predictions can win; needs known starts",
)


def make_predictor(name: str, **settings: Any) -> Predictor:  # noqa: ANN401
    """Return a new predictor by name.

    Raises
    ------
    ValueError
        If the name or a setting is unknown, or it is no predictor.
    """
    try:
        made = PREDICTORS[name](**settings)
    except TypeError as error:
        raise ValueError(f"predictor {name!r} cannot be made with {sorted(settings)}: {error}") from error
    check_predictor(made)
    return made


def check_predictor(predictor: object) -> None:
    """Check that an object can predict."""
    if not callable(getattr(predictor, "predict", None)):
        raise ValueError(f"predictor {shown(predictor)} has no method predict(partial); want one")


def begin_episode(predictor: Predictor, team: Any) -> None:  # noqa: ANN401
    """Tell a predictor that an episode of a team begins, if it wants to know."""
    reset = getattr(predictor, "reset", None)
    if reset is not None:
        reset(team)


def predicted(predictor: Predictor, partial: PartialMap) -> NDArray[np.float32] | None:
    """Return a checked prediction: 1 in known free squares, 0 in known occupied ones.

    Raises
    ------
    ValueError
        If the predictor returns an array of another shape, or numbers that are no probabilities.
    """
    found = predictor.predict(partial)
    if found is None:
        return None
    name, levels = type(predictor).__name__, partial.levels
    if not isinstance(found, np.ndarray) or found.shape != levels.shape or found.dtype.kind not in "fiub":
        what = f"{found.dtype} {found.shape}" if isinstance(found, np.ndarray) else shown(found)
        raise ValueError(
            f"predictor {name} returned {what}; want an array {levels.shape} of float32, a probability for each square"
        )
    probability = np.where(levels == FREE, 1.0, np.where(levels == OCCUPIED, 0.0, found)).astype(np.float32)
    if not (probability.min(initial=0.0) >= 0.0 and probability.max(initial=1.0) <= 1.0):
        worst = probability[~((probability >= 0.0) & (probability <= 1.0))][0]
        raise ValueError(f"predictor {name} returned {worst}; want probabilities from 0 to 1")
    return probability
