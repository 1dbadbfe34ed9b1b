"""A bank made in a folder: what is there is not made again."""

import json
from pathlib import Path
from typing import Any

import lidarium
from lidarium.benchmarks.studies.merging.bank.bank import (
    drives_of,
    fill,
    missing_drives,
    read_maps,
    read_pairs,
    write_pairs,
)
from lidarium.benchmarks.studies.merging.bank.floors import BankFloor
from lidarium.benchmarks.studies.merging.bank.pairs import Wanted, choose_pairs
from lidarium.benchmarks.studies.shared.study import Progress
from lidarium.mapping.files.output import write_json

DATA_FILE = "floors.json"


def make_bank(folder: Path, floors: list[BankFloor], workers: int, every: int = 1) -> Progress:
    """Drive on the floors what is missing, and choose the pairs, an N-th of those that are wanted.

    Yields what is being done, how much is, and of how much.
    """
    _check_same(folder / DATA_FILE, floors)
    total = len(drives_of(floors))
    first, failures = total - len(missing_drives(folder, floors)) + 1, []
    for done, (drive, error) in enumerate(fill(folder, floors, workers), first):
        if error is not None:
            failures.append(f"{drive.name}: {error}")
        yield "drives", done, total
    if failures:
        raise ValueError(f"{len(failures)} drives came to no end, the first is {failures[0]}")
    if read_pairs(folder) is None:
        pairs = []
        for pair in choose_pairs(read_maps(folder, floors), wanted=Wanted().part(every)):
            pairs.append(pair)
            yield "labelled pairs", len(pairs), len(pairs)
        write_pairs(folder, pairs)


def kept_floors(folder: Path) -> list[BankFloor]:
    """Return the floors of a bank in a folder."""
    entries = json.loads((folder / DATA_FILE).read_text(encoding="utf-8"))["floors"]
    return [BankFloor(**{**one, "path": None if one["path"] is None else Path(one["path"])}) for one in entries]


def _check_same(path: Path, floors: list[BankFloor]) -> None:
    """Note which floors the bank has; a bank of others is refused."""
    asked = {"version": lidarium.__version__, "floors": [_entry(floor) for floor in floors]}
    if path.exists() and json.loads(path.read_text(encoding="utf-8")) != asked:
        raise ValueError(
            f"{path.parent} holds a bank of other floors or of another version; choose another folder with --runs"
        )
    write_json(path, asked)


def _entry(floor: BankFloor) -> dict[str, Any]:
    path = None if floor.path is None else str(floor.path)
    return {
        "name": floor.name,
        "half": floor.half,
        "kind": floor.kind,
        "seed": floor.seed,
        "path": path,
        "is_copy": floor.is_copy,
    }
