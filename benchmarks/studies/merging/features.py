"""Detectors, descriptors and methods of matching side by side.

They are compared as in the thesis, besides those of OpenCV.
"""

import math
import time
from collections.abc import Callable
from functools import partial
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from lidarium.benchmarks.studies.merging.bank.bank import BankMap, Pair
from lidarium.benchmarks.studies.merging.bank.drives import RESOLUTION
from lidarium.benchmarks.studies.merging.bank.pairs import PLENTY
from lidarium.benchmarks.studies.merging.peers import FEATURES, finders
from lidarium.benchmarks.studies.merging.trials import padded
from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.merging.alignment import AlignmentSettings, find_inliers
from lidarium.mapping.merging.corners import Corners, CornerSettings, detect_corners
from lidarium.mapping.merging.correspondence import METHODS, CorrespondenceSettings, match_corners
from lidarium.mapping.merging.described_map import DescribedMap
from lidarium.mapping.merging.descriptors import VARIANTS, DescriptorSettings, describe_corners
from lidarium.mapping.merging.grey_images import trajkovic_corners
from lidarium.mapping.merging.pair import described
from lidarium.mapping.merging.settings import MergeSettings

REPEATS, BURST = 20, 3
"""Rounds of each kind of work, and its repeats in each round. After another's round, caches hold nothing of it."""

TRAJKOVIC = (8000.0, 4000.0)
"""Thresholds of the detector of Trajkovic and Hedley that the thesis set for its maps [grey^2]."""

RIGHT_M, VOTED_M = 0.15, 0.5
"""Distances within which a match and a voted transform are right [m]. The transform is one that matches vote for."""


def images(maps: dict[str, BankMap]) -> dict[str, NDArray[np.uint8]]:
    """Return the drawn images of the thesis and some maps of the bank."""
    field, bar = 255 * (np.indices((204, 204)) // 25).sum(axis=0) % 510, np.full((507, 507), 255, np.uint8)
    bar[200:307, 40:467] = 0
    bar[40:467, 200:307] = 0
    found = {"chess 204": field.clip(0, 255).astype(np.uint8), "cross 507": bar}
    for key in _shown(maps):
        found[key] = padded(maps[key].levels)
    return found


def compare_detectors(maps: dict[str, BankMap]) -> list[dict[str, Any]]:
    """Return points, least time [us] and stability of each detector on each image.

    One thread, the runs of all detectors in turn. Stability is the share of points that all runs find, of
    those that any finds.
    """
    cv2.setNumThreads(1)
    raw = CornerSettings(separation_m=0.0, limit=0)
    peers = finders()
    detectors: dict[str, Callable[[NDArray[np.uint8]], int]] = {
        "ours": lambda image: len(detect_corners(image, RESOLUTION, raw)),
        "goodFeaturesToTrack": lambda image: len(cv2.goodFeaturesToTrack(image, 500, 0.01, 3)),
        "Trajkovic": lambda image: len(trajkovic_corners(image, *TRAJKOVIC)),
        "Harris": lambda image: int(np.count_nonzero(cv2.cornerHarris(image, 3, 3, 0.04) > 0.01)),
        "FAST": lambda image: len(peers["fast"].detect(image)),
        "ORB": lambda image: len(peers["orb"].detect(image)),
        "SIFT": lambda image: len(peers["sift"].detect(image)),
    }
    return [
        {
            **_timed(name, image, detectors),
            "stable": {one: stability(find, image) for one, find in _point_finders(raw).items()},
        }
        for name, image in images(maps).items()
    ]


def _point_finders(raw: CornerSettings) -> dict[str, Callable[[NDArray[np.uint8]], NDArray[np.floating]]]:
    """Return what finds the points (n, 2) of an image, by detector."""
    found: dict[str, Callable[[NDArray[np.uint8]], NDArray[np.floating]]] = {
        "ours": lambda image: detect_corners(image, RESOLUTION, raw).points,
        "goodFeaturesToTrack": lambda image: np.asarray(
            cv2.goodFeaturesToTrack(image, 500, 0.01, 3), np.float64
        ).reshape(-1, 2),
        "Trajkovic": lambda image: trajkovic_corners(image, *TRAJKOVIC).astype(float),
        "Harris": lambda image: np.argwhere(cv2.cornerHarris(image, 3, 3, 0.04) > 0.01).astype(float),
    }
    return found | {name.upper(): partial(_keypoints, finder) for name, finder in finders().items()}


def _keypoints(finder: Any, image: NDArray[np.uint8]) -> NDArray[np.float64]:  # noqa: ANN401
    return np.array([point.pt for point in finder.detect(image)], np.float64).reshape(-1, 2)


def stability(
    find: Callable[[NDArray[np.uint8]], NDArray[np.floating]], image: NDArray[np.uint8], runs: int = REPEATS
) -> float:
    """Return the share of an image's points that all of some runs find, of those that any finds."""
    seen = [{tuple(point) for point in find(image).tolist()} for _ in range(runs)]
    any_run = set().union(*seen)
    return len(set(any_run).intersection(*seen)) / len(any_run) if any_run else 1.0


def compare_descriptors(maps: dict[str, BankMap]) -> list[dict[str, Any]]:
    """Return the least time of each descriptor on each image [us].

    It is for the points of the descriptor's own detector.
    """
    cv2.setNumThreads(1)
    return [_timed(name, image, _describers(image)) for name, image in images(maps).items()]


def _describers(image: NDArray[np.uint8]) -> dict[str, Callable[[NDArray[np.uint8]], int]]:
    """Return what describes the points of an image, each those of its own detector."""
    corners = detect_corners(image, RESOLUTION)
    found: dict[str, Callable[[NDArray[np.uint8]], int]] = {}
    for variant in VARIANTS:
        chosen = DescriptorSettings(variant=variant)
        found[variant] = partial(_count_described, corners, chosen)
    for name in FEATURES:
        finder = finders()[name]
        found[name] = partial(_count_computed, finder, finder.detect(image))
    return found


def _count_described(corners: Corners, chosen: DescriptorSettings, image: NDArray[np.uint8]) -> int:
    return len(describe_corners(image, RESOLUTION, corners, chosen).values)


def _count_computed(finder: Any, points: Any, image: NDArray[np.uint8]) -> int:  # noqa: ANN401
    return len(finder.compute(image, points)[0])


def compare_methods(maps: dict[str, BankMap], pairs: list[Pair]) -> list[dict[str, Any]]:
    """Return what each method of matching finds on positives.

    It is matches, right ones, pairs with two right ones or more, and time [ms].
    """
    settings = MergeSettings()
    chosen = [pair for pair in pairs if pair.category == "positive" and pair.overlap >= PLENTY][:60]
    if not chosen:
        return []
    features = {key: described(maps[key].levels, RESOLUTION, settings) for pair in chosen for key in (pair.a, pair.b)}
    rows = []
    for method in METHODS:
        correspondence = CorrespondenceSettings(method=method)
        found = [
            _matched(pair, features[pair.a], features[pair.b], correspondence, settings.alignment) for pair in chosen
        ]
        matches, right, votes, spent = np.array(found, np.float64).reshape(-1, 4).T
        rows.append(
            {
                "method": method,
                "pairs": len(chosen),
                "matches": float(np.median(matches)),
                "right": float(np.median(right)),
                "two_right": float((right >= 2).mean()),
                "voted": float(votes.mean()),
                "time_ms": float(np.median(spent)),
            }
        )
    return rows


def _matched(
    pair: Pair, a: DescribedMap, b: DescribedMap, correspondence: CorrespondenceSettings, alignment: AlignmentSettings
) -> tuple[int, int, bool, float]:
    """Return the figures of one matching, with its time [ms].

    They are the number of matches, of right ones, and whether the transform with most inliers is about
    right.
    """
    true = pair.a_from_b
    assert true is not None
    began = time.process_time()
    matches = match_corners(a.corners, b.corners, a.descriptors, b.descriptors, correspondence)
    spent = 1e3 * (time.process_time() - began)
    apart = np.linalg.norm(true.apply(b.corners.points[matches.second]) - a.corners.points[matches.first], axis=1)
    proposals, is_inlier = find_inliers(a.corners, b.corners, matches, RESOLUTION, alignment)
    best = None if len(proposals) == 0 else Transform(*proposals[int(is_inlier.sum(axis=1).argmax())].tolist())
    is_voted = best is not None and best.difference(true, pair.at)[0] <= VOTED_M
    return len(matches), int(np.count_nonzero(apart <= RIGHT_M)), is_voted, spent


def _timed(name: str, image: NDArray[np.uint8], work: dict[str, Callable[[NDArray[np.uint8]], int]]) -> dict[str, Any]:
    """Do each kind of work on an image, and time it.

    The kinds alternate; returned are how many points there were and the least time of each.
    """
    least = dict.fromkeys(work, math.inf)
    points = {one: function(image) for one, function in work.items()}
    for _ in range(REPEATS):
        for one, function in work.items():
            for _ in range(BURST):
                began = time.perf_counter()
                function(image)
                least[one] = min(least[one], 1e6 * (time.perf_counter() - began))
    return {
        "image": name,
        "shape": list(image.shape),
        "points": points,
        "time_us": {one: round(value, 1) for one, value in least.items()},
    }


def _shown(maps: dict[str, BankMap]) -> list[str]:
    """Return the last maps of some test floors that fit into a standard map. The floors are of the test half."""
    keys = [
        key for key, one in maps.items() if one.floor.half == "test" and one.stage == 2 and max(one.levels.shape) <= 512
    ]
    return [
        next(key for key in keys if key.startswith(kind))
        for kind in ("apartment-", "real-", "like_rooms-")
        if any(key.startswith(kind) for key in keys)
    ]
