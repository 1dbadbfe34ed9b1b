"""Detectors, descriptors and methods of matching side by side, each as the thesis compared them, beside those of OpenCV."""

import math
import time
from collections.abc import Callable
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from lidarium.evaluation.merging.bank import BankMap, Pair
from lidarium.evaluation.merging.drives import RESOLUTION
from lidarium.evaluation.merging.trials import padded
from lidarium.mapping.merging.alignment import find_inliers
from lidarium.mapping.merging.corners import CornerSettings, detect_corners
from lidarium.mapping.merging.correspondence import METHODS, CorrespondenceSettings, match_corners
from lidarium.mapping.merging.descriptors import VARIANTS, DescriptorSettings, describe_corners
from lidarium.mapping.merging.pair import described
from lidarium.mapping.merging.settings import MergeSettings

REPEATS = 20
RIGHT_M = 0.15
"""Distance within which a match is right [m]."""


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
    """Return points and least time of each detector on each image [us]; one thread, the runs of all detectors in turn."""
    cv2.setNumThreads(1)
    raw = CornerSettings(separation_m=0.0, limit=0)
    orb, sift, fast = cv2.ORB.create(), cv2.SIFT.create(), cv2.FastFeatureDetector.create()
    detectors: dict[str, Callable[[NDArray[np.uint8]], int]] = {
        "ours": lambda image: len(detect_corners(image, RESOLUTION, raw)),
        "goodFeaturesToTrack": lambda image: len(cv2.goodFeaturesToTrack(image, 500, 0.01, 3)),
        "Harris": lambda image: int(np.count_nonzero(cv2.cornerHarris(image, 3, 3, 0.04) > 0.01)),
        "FAST": lambda image: len(fast.detect(image)),
        "ORB": lambda image: len(orb.detect(image)),
        "SIFT": lambda image: len(sift.detect(image)),
    }
    return [_timed(name, image, detectors) for name, image in images(maps).items()]


def compare_descriptors(maps: dict[str, BankMap]) -> list[dict[str, Any]]:
    """Return the least time of each descriptor on each image [us], for the points of its own detector."""
    cv2.setNumThreads(1)
    rows = []
    for name, image in images(maps).items():
        corners = detect_corners(image, RESOLUTION)
        ours = {
            variant: (lambda levels, chosen=DescriptorSettings(variant=variant), at=corners: len(describe_corners(levels, RESOLUTION, at, chosen).values))
            for variant in VARIANTS
        }
        peers = {}
        for peer, finder in (("ORB", cv2.ORB.create()), ("SIFT", cv2.SIFT.create()), ("AKAZE", cv2.AKAZE.create())):
            points = finder.detect(image)
            peers[peer] = lambda levels, by=finder, at=points: len(by.compute(levels, at)[0])
        rows.append(_timed(name, image, {**ours, **peers}))
    return rows


def compare_methods(maps: dict[str, BankMap], pairs: list[Pair]) -> list[dict[str, Any]]:
    """Return for each method of matching what it finds on positives: matches, right ones, pairs with two right ones or more, time [ms]."""
    settings = MergeSettings()
    rows = []
    chosen = [pair for pair in pairs if pair.category == "positive" and pair.overlap >= 0.3][:60]
    both = [(pair, *(described(maps[key].levels, RESOLUTION, settings) for key in (pair.a, pair.b))) for pair in chosen]
    for method in METHODS:
        counts, right, spent, voted = [], [], [], 0
        for pair, a, b in both:
            began = time.process_time()
            matches = match_corners(a.corners, b.corners, a.descriptors, b.descriptors, CorrespondenceSettings(method=method))
            spent.append(1e3 * (time.process_time() - began))
            assert pair.a_from_b is not None
            apart = np.linalg.norm(pair.a_from_b.apply(b.corners.points[matches.second]) - a.corners.points[matches.first], axis=1)
            counts.append(len(matches))
            right.append(int(np.count_nonzero(apart <= RIGHT_M)))
            proposals, is_inlier = find_inliers(a.corners, b.corners, matches, RESOLUTION, settings.alignment)
            if len(proposals):
                best = proposals[int(is_inlier.sum(axis=1).argmax())]
                image = np.array([math.cos(best[2]) * pair.at[0] - math.sin(best[2]) * pair.at[1] + best[0], math.sin(best[2]) * pair.at[0] + math.cos(best[2]) * pair.at[1] + best[1]])
                voted += bool(np.linalg.norm(image - pair.a_from_b.apply(pair.at)) <= 0.5)
        rows.append(
            {
                "method": method,
                "pairs": len(both),
                "matches": float(np.median(counts)),
                "right": float(np.median(right)),
                "two_right": float(np.mean(np.array(right) >= 2)),
                "voted": voted / max(len(both), 1),
                "time_ms": float(np.median(spent)),
            }
        )
    return rows


def _timed(name: str, image: NDArray[np.uint8], work: dict[str, Callable[[NDArray[np.uint8]], int]]) -> dict[str, Any]:
    """Do each kind of work on an image, all in turn, and return how many points there were and the least time of each."""
    least = dict.fromkeys(work, math.inf)
    points = {one: function(image) for one, function in work.items()}
    for _ in range(REPEATS):
        for one, function in work.items():
            began = time.perf_counter()
            function(image)
            least[one] = min(least[one], 1e6 * (time.perf_counter() - began))
    return {"image": name, "shape": list(image.shape), "points": points, "time_us": {one: round(value, 1) for one, value in least.items()}}


def _shown(maps: dict[str, BankMap]) -> list[str]:
    """Return the last maps of some floors of the test half that fit into a standard map."""
    keys = [key for key, one in maps.items() if one.floor.half == "test" and one.stage == 2 and max(one.levels.shape) <= 512]
    return [next(key for key in keys if key.startswith(kind)) for kind in ("apartment-", "real-", "like_rooms-") if any(key.startswith(kind) for key in keys)]
