"""The bank in a folder: the maps of every drive, and pairs of them.

Each map is made once; each pair has what is true of it.

``maps/`` holds a file for each drive; what is there is not driven again. ``pairs.json`` holds the pairs that
are asked of a merger.
"""

import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.benchmarks.studies.merging.bank.drives import RUNS, SNAPSHOTS, STARTS, bank_starts, drive
from lidarium.benchmarks.studies.merging.bank.floors import BankFloor
from lidarium.envs.floors.floor import Floor
from lidarium.evaluation.processes import shared_out
from lidarium.mapping.files.output import whole_file, write_json
from lidarium.mapping.geometry.rigid import Transform

MAPS_FOLDER, PAIRS_FILE = "maps", "pairs.json"

LIKE_ROOMS_SHARES = (0.12, 0.35, 0.9)
"""Shares of the floor at which maps are kept in buildings of like rooms.

At the first share the robot has seen little but its own room.
"""


@dataclass(frozen=True, slots=True)
class Drive:
    """A drive of the bank: a floor, one of its starts, and one of the runs from there."""

    floor: BankFloor
    start: int
    run: int

    @property
    def name(self) -> str:
        """Stem of the file of its maps."""
        return f"{self.floor.name}_{self.start}_{self.run}"


@dataclass(frozen=True, slots=True, eq=False)
class BankMap:
    """A map of the bank.

    `key`: name of its drive and number of the snapshot; `floor`: where it was made; `start`, `stage`: from where, and
    which snapshot; `levels` (rows, columns) uint8: the map; `floor_from_map`: where it truly lies.
    """

    key: str
    floor: BankFloor
    start: int
    stage: int
    levels: NDArray[np.uint8]
    floor_from_map: Transform


@dataclass(frozen=True, slots=True)
class Pair:
    """Two maps, and what is true of them.

    `a`, `b`: keys of the maps; `half`: ``tuning`` or ``test``; `category`: ``positive``; ``refurnished``, a positive
    whose furniture was taken away between the maps; ``negative``; ``look_alike``, a negative that differs by 1 m of
    wall or more wherever it looks alike; ``symmetric``, a positive that another transform explains as well;
    ``indistinct``, a negative that differs by less; `overlap`: share of the smaller known area that both know, of maps
    of one floor; `pose` (x, y, theta) or None: the true ``a_from_b`` of a positive [m, rad]; `at` (x, y): centroid of
    the overlap in map b [m]; `differing_m`: least length of walls that differ where a negative looks alike [m].
    """

    a: str
    b: str
    half: str
    category: str
    overlap: float = 0.0
    pose: tuple[float, float, float] | None = None
    at: tuple[float, float] = (0.0, 0.0)
    differing_m: float = 0.0

    @property
    def a_from_b(self) -> Transform | None:
        """The true transform of a positive."""
        return None if self.pose is None else Transform(*self.pose)


def drives_of(floors: list[BankFloor]) -> list[Drive]:
    """Return the drives of a bank; copies are driven once from each start."""
    return [
        Drive(floor, start, run)
        for floor in floors
        for start in range(STARTS)
        for run in range(1 if floor.is_copy else RUNS)
    ]


def missing_drives(folder: Path, floors: list[BankFloor]) -> list[Drive]:
    """Return the drives of a bank whose maps are not there yet."""
    return [drive for drive in drives_of(floors) if not _file_of(folder, drive).exists()]


def fill(folder: Path, floors: list[BankFloor], workers: int) -> Iterator[tuple[Drive, Exception | None]]:
    """Drive what the bank lacks, and yield each drive once its maps are saved.

    A drive that fails is yielded with the error that it ended with.
    """
    for done, result in shared_out(partial(_drive_into, folder), missing_drives(folder, floors), workers):
        yield done, result if isinstance(result, Exception) else None


def read_maps(folder: Path, floors: list[BankFloor]) -> dict[str, BankMap]:
    """Return the maps of a bank that is filled, by key."""
    maps: dict[str, BankMap] = {}
    for drive_ in drives_of(floors):
        path = _file_of(folder, drive_)
        if not path.exists():
            raise FileNotFoundError(f"the bank has no {path}; fill it first")
        with np.load(path) as content:
            for stage, pose in enumerate(content["poses"].tolist()):
                key = f"{drive_.name}_{stage}"
                maps[key] = BankMap(
                    key, drive_.floor, drive_.start, stage, content[f"levels_{stage}"], Transform(*pose)
                )
    return maps


def write_pairs(folder: Path, pairs: list[Pair]) -> None:
    """Keep the pairs of a bank."""
    write_json(folder / PAIRS_FILE, {"pairs": [asdict(pair) for pair in pairs]})


def read_pairs(folder: Path) -> list[Pair] | None:
    """Return the pairs of a bank, None if there are none yet."""
    path = folder / PAIRS_FILE
    if not path.exists():
        return None
    entries = json.loads(path.read_text(encoding="utf-8"))["pairs"]
    return [Pair(**{**one, "pose": one["pose"] and tuple(one["pose"]), "at": tuple(one["at"])}) for one in entries]


def _file_of(folder: Path, drive_: Drive) -> Path:
    return Path(folder) / MAPS_FOLDER / f"{drive_.name}.npz"


def _drive_into(folder: Path, drive_: Drive) -> None:
    """Do one drive and keep its maps."""
    floor = _loaded(drive_.floor)
    # Original and copy have starts of their own, as the furniture may stand on a start otherwise.
    seed = drive_.floor.seed
    start = bank_starts(floor, seed)[drive_.start] + (0.0, 0.0, 2.0 * drive_.run)
    shares = LIKE_ROOMS_SHARES if drive_.floor.kind == "like_rooms" else SNAPSHOTS
    noise = [*drive_.name.encode(), seed]
    snapshots = drive(floor, start, int(np.random.SeedSequence(noise).generate_state(1)[0]), shares=shares)
    arrays: dict[str, Any] = {f"levels_{stage}": snapshot.levels for stage, snapshot in enumerate(snapshots)}
    poses = [(one.floor_from_map.x, one.floor_from_map.y, one.floor_from_map.theta) for one in snapshots]
    with whole_file(_file_of(folder, drive_)) as beside:
        np.savez_compressed(
            beside,
            poses=poses,
            times=[one.time_s for one in snapshots],
            coverages=[one.coverage for one in snapshots],
            **arrays,
        )


@lru_cache(maxsize=4)
def _loaded(floor: BankFloor) -> Floor:
    return floor.load()
