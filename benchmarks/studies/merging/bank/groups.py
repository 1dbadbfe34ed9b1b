"""Many maps at once, and pairs of real maps.

The many are five robots' maps of one floor; real robots made the pairs.
"""

import json
import math
import time
from pathlib import Path
from typing import Any

import cv2

from lidarium.benchmarks.studies.merging.bank.bank import BankMap
from lidarium.benchmarks.studies.merging.bank.drives import RESOLUTION
from lidarium.benchmarks.studies.merging.bank.pairs import overlap_of
from lidarium.mapping.files.map_files import read_grey_map
from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.merging.merger import merge_maps
from lidarium.mapping.merging.pair import described, merge_pair
from lidarium.mapping.merging.settings import merge_settings

TEAM = 5


def merge_teams(maps: dict[str, BankMap]) -> list[dict[str, Any]]:
    """Merge the last maps of five robots on each floor of the test half.

    Returns how many are joined, errors [m, rad] and time [s].
    """
    cv2.setNumThreads(1)
    rows = []
    floors = dict.fromkeys(
        one.floor.name for one in maps.values() if one.floor.half == "test" and not one.floor.is_copy
    )
    for floor in floors:
        team = [one for one in maps.values() if one.floor.name == floor and one.stage == 2][:TEAM]
        began = time.process_time()
        merged = merge_maps({one.key: (one.levels, RESOLUTION) for one in team})
        seconds = time.process_time() - began
        group = max(merged.groups(), key=len)
        distances, angles = [0.0], [0.0]
        root = next(one for one in team if one.key == group[0])
        for one in team:
            found = merged.tree.lookup(root.key, one.key) if one.key in group else None
            if found is not None and one is not root:
                true = root.floor_from_map.inverse() @ one.floor_from_map
                distance, angle = found.difference(true, overlap_of(root, one, true)[1])
                distances.append(distance)
                angles.append(angle)
        rows.append(
            {
                "floor": floor,
                "robots": len(team),
                "joined": len(group),
                "distance_m": max(distances),
                "angle": max(angles),
                "time_s": seconds,
            }
        )
    return rows


def merge_real_pairs(data: Path) -> list[dict[str, Any]]:
    """Merge the pairs of maps rendered from real logs.

    Returns errors at the overlap [m, rad] or why they were refused.
    """
    folder = Path(data) / "map_pairs" / "log_split"
    if not (folder / "ground_truth.json").is_file():
        return []
    rows = []
    for name, truth in json.loads((folder / "ground_truth.json").read_text()).items():
        if "pixel" not in truth:
            continue
        rows.append({"pair": name, **_merge_real(folder, truth)})
    return rows


def _merge_real(folder: Path, truth: dict[str, Any]) -> dict[str, Any]:
    resolution, settings = float(truth["resolution"]), merge_settings()
    levels = [read_grey_map(folder / truth[key], resolution).levels for key in "AB"]
    began = time.process_time()
    a, b = (described(one, resolution, settings) for one in levels)
    result = merge_pair(a, b, settings)
    spent = 1e3 * (time.process_time() - began)
    error = (math.nan, math.nan)
    if result.a_from_b is not None:
        error = result.a_from_b.difference(
            transform_of_pixels(truth["pixel"], resolution, *(len(one) for one in levels)),
            result.agreement.centre,
        )
    return {
        "is_accepted": result.is_accepted,
        "reason": result.reason,
        "found_by": result.found_by,
        "distance_m": None if math.isnan(error[0]) else error[0],
        "angle": None if math.isnan(error[1]) else error[1],
        "cells": max(one.size for one in levels),
        "time_ms": spent,
    }


def transform_of_pixels(pixel: dict[str, float], resolution: float, rows_a: int, rows_b: int) -> Transform:
    """Return the transform from map b into a of a pair given in pixels.

    Its truth is q_a = R q_b + t in pixels whose y runs down.
    """
    theta = math.radians(pixel["theta_deg"])
    corner = Transform(pixel["tx"], pixel["ty"], theta).apply((0.0, rows_b))
    return Transform(float(corner[0]) * resolution, (rows_a - float(corner[1])) * resolution, -theta)
