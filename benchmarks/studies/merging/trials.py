"""Methods tried on the pairs of the bank.

Each result is what the method says of every pair, and the time that it takes.
"""

import json
import math
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from lidarium.benchmarks.studies.merging.bank.bank import BankMap, Pair
from lidarium.benchmarks.studies.merging.bank.drives import RESOLUTION
from lidarium.benchmarks.studies.merging.peers import FEATURES, features_of, match_peers
from lidarium.evaluation.processes import shared_out
from lidarium.mapping.files.output import write_json
from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.grids.occupancy import UNKNOWN
from lidarium.mapping.merging.agreement import Agreement
from lidarium.mapping.merging.described_map import DescribedMap
from lidarium.mapping.merging.pair import described, merge_pair
from lidarium.mapping.merging.settings import MODES, MergeSettings, merge_settings

METHODS = (*MODES, *FEATURES)

SIDE = 512
"""Maps that are smaller are padded to squares of this side [cells]. Times are quoted of pairs of such maps."""

CHUNK = 40
"""Pairs that are tried in a row and kept together."""


@dataclass(frozen=True, slots=True)
class Outcome:
    """What a method said of a pair.

    `is_accepted`: whether it joined the maps; `reason`: why not; `distance_m`, `angle`: error of its transform at the
    overlap's centroid [m, rad], of positives for which it has one; `found_by`: ``corners``, ``correlation``, or the
    name of a peer; `confidence`: by which a threshold may be set; `time_ms`: processor time, detection and description
    of both maps included [ms]; `is_standard`: whether both maps have `SIDE` x `SIDE` cells; `overlap_m2`, `agreeing_m`,
    `wall_m`, `across_m`, `contradicting_m`: as of `Agreement`, of our own methods.
    """

    is_accepted: bool
    reason: str
    distance_m: float | None
    angle: float | None
    found_by: str
    confidence: float
    time_ms: float
    is_standard: bool
    overlap_m2: float = 0.0
    agreeing_m: float = 0.0
    wall_m: float = 0.0
    across_m: float = 0.0
    contradicting_m: float = 0.0

    @property
    def needed_fallback(self) -> bool:
        """Whether all rotations and translations were tried. Corners then gave nothing that passes on its own."""
        return not (self.found_by == "corners" and (self.is_accepted or ": moved by" in self.reason))

    @property
    def is_exact(self) -> bool:
        """Whether the transform is right: within 0.10 m and 1 degree."""
        return (
            self.distance_m is not None
            and self.distance_m <= 0.10
            and self.angle is not None
            and self.angle <= math.radians(1.0)
        )


def try_pairs(
    folder: Path,
    maps: dict[str, BankMap],
    pairs: list[Pair],
    method: str,
    workers: int,
    settings: MergeSettings | None = None,
) -> Iterator[int]:
    """Try a method on pairs, kept by `CHUNK` in a folder. Yields how many are there, as they come."""
    if method not in METHODS:
        raise ValueError(f"method is {method!r}; want one of {', '.join(METHODS)}")
    chunks = [pairs[first : first + CHUNK] for first in range(0, len(pairs), CHUNK)]
    missing = [
        (number, [(pair, maps[pair.a], maps[pair.b]) for pair in chunk])
        for number, chunk in enumerate(chunks)
        if not _file_of(folder, method, number).exists()
    ]
    done = len(pairs) - sum(len(tasks) for _, tasks in missing)
    yield done
    for (_, tasks), result in shared_out(
        partial(_try_chunk, folder, method, settings), missing, workers, is_apart=True
    ):
        if isinstance(result, Exception):
            raise result
        done += len(tasks)
        yield done


def read_outcomes(folder: Path, pairs: list[Pair], method: str) -> list[Outcome]:
    """Return what a method said of the pairs that were tried."""
    entries: list[dict[str, Any]] = []
    for number in range(math.ceil(len(pairs) / CHUNK)):
        entries += json.loads(_file_of(folder, method, number).read_text(encoding="utf-8"))["outcomes"]
    return [Outcome(**one) for one in entries]


def padded(levels: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return a map padded to `SIDE` rows and columns at least. Unknown cells are added at its upper ends."""
    rows, columns = (max(side, SIDE) for side in levels.shape)
    grown = np.full((rows, columns), UNKNOWN, np.uint8)
    grown[: levels.shape[0], : levels.shape[1]] = levels
    return grown


def _file_of(folder: Path, method: str, number: int) -> Path:
    return Path(folder) / f"{method}_{number:03d}.json"


def _try_chunk(
    folder: Path, method: str, settings: MergeSettings | None, task: tuple[int, list[tuple[Pair, BankMap, BankMap]]]
) -> None:
    number, tasks = task
    _warm_up(method, settings)
    outcomes = [_tried(pair, a, b, method, settings) for pair, a, b in tasks]
    write_json(_file_of(folder, method, number), {"outcomes": [asdict(one) for one in outcomes]})


def _tried(pair: Pair, a: BankMap, b: BankMap, method: str, settings: MergeSettings | None) -> Outcome:
    first, second = padded(a.levels), padded(b.levels)
    is_standard = max(*first.shape, *second.shape) == SIDE
    began = time.process_time()
    agreement = Agreement()
    if method in MODES:
        chosen = settings or merge_settings(method, RESOLUTION)
        described_maps = _both(first, second, chosen)
        result = merge_pair(*described_maps, chosen)
        found, is_accepted, reason, by = result.a_from_b, result.is_accepted, result.reason, result.found_by
        confidence, agreement = result.score, result.agreement
    else:
        peer = match_peers(features_of(first, method), features_of(second, method), RESOLUTION)
        found, is_accepted, reason, by, confidence = (peer.a_from_b, peer.confidence > 0.0, "", method, peer.confidence)
    time_ms = 1e3 * (time.process_time() - began)
    distance, angle = (
        (None, None) if found is None or pair.a_from_b is None else found.difference(pair.a_from_b, pair.at)
    )
    walls = (
        agreement.overlap_m2,
        agreement.agreeing_m,
        agreement.wall_m,
        agreement.across_m,
        agreement.contradicting_m,
    )
    return Outcome(
        is_accepted,
        reason,
        distance,
        angle,
        by,
        confidence,
        round(time_ms, 3),
        is_standard,
        *(round(one, 4) for one in walls),
    )


def _both(a: NDArray[np.uint8], b: NDArray[np.uint8], settings: MergeSettings) -> tuple[DescribedMap, DescribedMap]:
    return described(a, RESOLUTION, settings), described(b, RESOLUTION, settings)


@lru_cache
def _warm_up(method: str, settings: MergeSettings | None) -> None:
    """Compile the kernels before anything is timed, and use one thread. Everything runs on that one thread."""
    from lidarium.benchmarks.studies.merging.bank.floors import BankFloor

    cv2.setNumThreads(1)
    levels = np.full((200, 200), UNKNOWN, np.uint8)
    levels[20:180, 20:160] = 0
    levels[22:178, 22:158] = 255
    levels[60:62, 60:120] = 0
    one = BankMap("", BankFloor("", "", ""), 0, 0, levels, Transform())
    for _ in range(2):
        _tried(Pair("", "", "", "positive", pose=(0.0, 0.0, 0.0)), one, one, method, settings)
