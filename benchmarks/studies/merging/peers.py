"""The pipeline by which ROS map_merge joins maps, from OpenCV's stitching.

It has features, their best of two nearest, and an affine motion by RANSAC.

References
----------
Horner, "Map-merging for multi-robot system", 2016, and its package m-explore `map_merge` (BSD): ORB, AKAZE or
SURF features, `AffineBestOf2NearestMatcher` without shear, confidence of a pair as inliers / (8 + 0.3
matches). OpenCV 5 has neither AKAZE nor SURF any more; SIFT, the most distinctive of what it has, stands in
their place.
"""

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.geometry.rigid import Transform

FEATURES = ("orb", "sift")

_CV: Any = cv2
"""OpenCV, of which the type stubs lack a part."""


@dataclass(frozen=True, slots=True)
class PeerResult:
    """What the pipeline made of two maps.

    `confidence`: by which a pair is accepted; 0 if no motion was found; `a_from_b`: the motion [m], its scale left out;
    `scale`: that scale.
    """

    confidence: float = 0.0
    a_from_b: Transform | None = None
    scale: float = 1.0


def features_of(levels: NDArray[np.uint8], kind: str) -> Any:  # noqa: ANN401
    """Return what OpenCV computes of a map, for `match_peers`."""
    return _CV.detail.computeImageFeatures2(_finder(kind), levels)


def match_peers(a: Any, b: Any, resolution: float) -> PeerResult:  # noqa: ANN401
    """Join two maps by their features."""
    if len(a.getKeypoints()) < 2 or len(b.getKeypoints()) < 2:
        return PeerResult()
    cv2.setRNGSeed(0)
    found = _matcher().apply(b, a)
    if found.H is None or found.H.size == 0 or not np.isfinite(found.H).all() or found.confidence <= 0.0:
        return PeerResult()
    matrix = found.H
    scale = math.hypot(matrix[0, 0], matrix[1, 0])
    # Pixels are placed by their centres.
    turn = matrix[:2, :2] / max(scale, 1e-9)
    x, y = ((matrix[:2, 2] + 0.5 - turn @ (0.5, 0.5)) * resolution).tolist()
    return PeerResult(float(found.confidence), Transform(x, y, math.atan2(matrix[1, 0], matrix[0, 0])), scale)


@lru_cache
def _finder(kind: str) -> Any:  # noqa: ANN401
    return finders()[kind]


@lru_cache
def _matcher() -> Any:  # noqa: ANN401
    return _CV.detail.AffineBestOf2NearestMatcher(False, False, 0.3)


def finders() -> dict[str, Any]:
    """Return OpenCV's features by name, with its own settings."""
    return {"orb": _CV.ORB.create(), "sift": _CV.SIFT.create(), "fast": _CV.FastFeatureDetector.create()}
