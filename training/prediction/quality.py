"""How good predictions are: squares right near what is known, beside two guesses without a network, and calibration."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.prediction.levels import FREE, SIDE, UNKNOWN

NEAR_M = 3.0
"""Unknown squares up to so far from known ones are counted [m]."""

BINS = 10
"""Bins of probabilities of the calibration error."""


@dataclass(frozen=True, slots=True)
class Quality:
    """Errors of predictions on some maps.

    Attributes
    ----------
    squares : int
        Unknown squares within ``NEAR_M`` of known ones.
    wrong, wrong_all_free, wrong_nearest : float
        Share of them that are wrong: of the prediction, if all were free, and if each were as the nearest known one.
    calibration : float
        Expected calibration error: mean distance of the predicted from the true share of free squares, by bins of
        the probability.
    """

    squares: int
    wrong: float
    wrong_all_free: float
    wrong_nearest: float
    calibration: float

    def as_dict(self) -> dict[str, float]:
        """Return it as types that JSON has."""
        return asdict(self)


class QualityTally:
    """Counts over many maps.

    Parameters
    ----------
    counts : sequence of float, optional
        Counts of other tallies, to go on from.
    """

    def __init__(self, counts: Sequence[float] = (0.0,) * (4 + 3 * BINS)) -> None:
        self._counts = np.array(counts[:4], np.float64)
        self._bins = np.array(counts[4:], np.float64).reshape(3, BINS)

    @property
    def counts(self) -> list[float]:
        """The counts as numbers, which may be summed."""
        return [*self._counts.tolist(), *self._bins.reshape(-1).tolist()]

    def add(self, probability: NDArray[np.float32], levels: NDArray[np.int8], is_free: NDArray[np.bool_]) -> None:
        """Count a map; all are (rows, columns)."""
        is_known = levels != UNKNOWN
        if not is_known.any():
            return
        distances, labels = cv2.distanceTransformWithLabels(
            (~is_known).astype(np.uint8), cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
        )
        is_near = (levels == UNKNOWN) & (distances <= NEAR_M / SIDE)
        free_of = np.zeros(int(labels.max()) + 1, np.bool_)
        free_of[labels[is_known]] = levels[is_known] == FREE
        predicted, truth = probability[is_near], is_free[is_near]
        wrong = ((predicted > 0.5) != truth).sum(), (~truth).sum(), (free_of[labels[is_near]] != truth).sum()
        self._counts += (len(truth), *wrong)
        bins = np.minimum((predicted * BINS).astype(np.int64), BINS - 1)
        for k, weights in enumerate((None, predicted, truth)):
            self._bins[k] += np.bincount(bins, weights, BINS)

    def quality(self) -> Quality:
        """Return the errors so far."""
        squares = max(self._counts[0], 1.0)
        gaps = np.abs(self._bins[1] - self._bins[2]).sum() / squares
        wrong, all_free, nearest = (float(each / squares) for each in self._counts[1:])
        return Quality(int(self._counts[0]), wrong, all_free, nearest, float(gaps))
