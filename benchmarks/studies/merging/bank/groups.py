"""Many maps at once: five robots' maps of one floor."""

import time
from typing import Any

import cv2

from lidarium.benchmarks.studies.merging.bank.bank import BankMap
from lidarium.benchmarks.studies.merging.bank.drives import RESOLUTION
from lidarium.benchmarks.studies.merging.bank.pairs import overlap_of
from lidarium.mapping.merging.merger import Question, merge_maps

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
        merged = merge_maps({one.key: (one.levels, RESOLUTION) for one in team}, question=Question(is_explained=False))
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
