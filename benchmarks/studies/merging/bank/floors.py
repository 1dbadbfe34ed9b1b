"""The floors of the bank.

They are generated, drawn and real ones, buildings of like rooms, and copies from which furniture was removed.

Each floor belongs to one half: limits are tuned on the one, figures are quoted on the other. A copy belongs
to the half of its original.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lidarium.benchmarks.studies.merging.bank.like_rooms import like_rooms
from lidarium.envs.floors.catalogue.names import load_floor
from lidarium.envs.floors.floor import Floor
from lidarium.envs.floors.generation.buildings import BuildingSettings, generate_building

HALVES = ("tuning", "test")

LASER_HEIGHT = 0.3
"""At which furniture has to stand to be seen [m]."""

_APARTMENTS, _OFFICES, _CORRIDORS, _LIKE_ROOMS, _REAL, _COPIED = 5, 4, 2, 4, 4, 9
_DRAWN = {"tuning": "clinic", "test": "scene_loop_corridor"}
_FIRST_SEED = {"tuning": 5000, "test": 8000}
_REAL_M2 = {"tuning": (55.0, 200.0), "test": (45.0, 55.0)}
"""Free area of real apartments of each half [m2]."""

_CONNECTED = 0.98
_AREAS = {
    "apartment": dict(enumerate((60.0, 80.0, 100.0, 120.0, 140.0))),
    "office": dict(enumerate((120.0, 140.0, 160.0, 180.0, 200.0))),
}
"""Floor areas of generated buildings by kind and seed modulo five [m2]."""


@dataclass(frozen=True, slots=True)
class BankFloor:
    """A floor of the bank.

    Attributes
    ----------
    name : str
        Its name, of letters that a file's name may have.
    half : str
        ``tuning`` or ``test``.
    kind : str
        ``apartment``, ``office`` and ``corridors`` are generated, ``like_rooms`` as well; ``drawn``; ``real``
        are apartments of LIFULL.
    seed : int
        Of a generated one.
    path : Path or None
        Of a real one.
    is_copy : bool
        Whether furniture was taken away from the floor of that kind and seed.
    """

    name: str
    half: str
    kind: str
    seed: int = 0
    path: Path | None = None
    is_copy: bool = False

    @property
    def original(self) -> str:
        """Name of the floor that it is a copy of; its own where it is none."""
        return self.name.removesuffix("-copy")

    def load(self) -> Floor:
        """Return the floor."""
        floor = self._load_original()
        return without_some_furniture(floor, self.seed) if self.is_copy else floor

    def _load_original(self) -> Floor:
        if self.path is not None:
            return load_floor(self.path)
        if self.kind == "drawn":
            return load_floor(self.name)
        if self.kind == "like_rooms":
            return like_rooms(self.seed)
        area = _AREAS.get(self.kind, {}).get(self.seed % 5)
        return generate_building(self.seed, BuildingSettings(kind=self.kind, area_m2=area))


def bank_floors(data: Path | None, every: int = 1) -> list[BankFloor]:
    """Return the floors of the bank.

    Parameters
    ----------
    data : Path or None
        Folder of real floors; without it there are the others alone.
    every : int
        Of each kind every so many-th is taken.
    """
    floors: list[BankFloor] = []
    for half in HALVES:
        first = _FIRST_SEED[half]
        for kind, count in (
            ("apartment", _APARTMENTS),
            ("office", _OFFICES),
            ("corridors", _CORRIDORS),
            ("like_rooms", _LIKE_ROOMS),
        ):
            floors += [
                BankFloor(f"{kind}-{seed}", half, kind, seed) for seed in range(first, first + count, every)
            ]
        floors.append(BankFloor(_DRAWN[half], half, "drawn"))
        chosen = [] if data is None else _real_floors(Path(data), *_REAL_M2[half])[:_REAL:every]
        floors += [BankFloor(f"real-{path.stem[:20]}", half, "real", path=path) for path in chosen]
        originals = [
            floor for floor in floors if floor.half == half and floor.kind in ("apartment", "office")
        ]
        copied = originals[:_COPIED]
        floors += [
            BankFloor(f"{floor.name}-copy", half, floor.kind, floor.seed, is_copy=True) for floor in copied
        ]
    return floors


def without_some_furniture(floor: Floor, seed: int) -> Floor:
    """Return a floor without one to three of its pieces of furniture.

    Those are pieces that a laser sees and that measure 0.35 m at least.
    """
    pieces = [
        index
        for index, solid in enumerate(floor.solids)
        if solid.cuts(LASER_HEIGHT, LASER_HEIGHT)
        and np.isfinite(solid.z_high)
        and np.ptp(solid.polygon, axis=0).min() >= 0.35
    ]
    if not pieces:
        raise ValueError(
            f"floor {floor.name!r} has no furniture that could be taken away; want one with some"
        )
    generator = np.random.default_rng(seed)
    count = min(int(generator.integers(1, 4)), len(pieces))
    taken = set(generator.choice(pieces, count, replace=False).tolist())
    solids = tuple(solid for index, solid in enumerate(floor.solids) if index not in taken)
    return Floor(f"{floor.name}-copy", floor.bounds, solids, starts=floor.starts)


def _real_floors(data: Path, least_m2: float, most_m2: float) -> list[Path]:
    """Return the files of connected LIFULL apartments of some free area [m2].

    Raises
    ------
    FileNotFoundError
        Where the folder has none.
    """
    import json

    folder = data / "floorplans" / "lifull"
    if not (folder / "meta.json").is_file():
        raise FileNotFoundError(f"no floors of LIFULL below {data}; want {folder.relative_to(data)} there")
    meta = json.loads((folder / "meta.json").read_text())
    areas = {
        name: one["free_px"] * one["resolution"] ** 2
        for name, one in meta.items()
        if one["conn"] >= _CONNECTED
    }
    wanted = [name for name, area in areas.items() if least_m2 <= area < most_m2]
    return [
        folder / "txt" / f"{name}.txt"
        for name in sorted(wanted)
        if (folder / "txt" / f"{name}.txt").is_file()
    ]
