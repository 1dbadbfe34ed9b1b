"""Floors of the bank, and floors with rooms that look alike."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.floors.catalogue.names import load_floor
from lidarium.envs.floors.floor import Floor, Solid
from lidarium.envs.floors.generation.buildings import BuildingSettings, generate_building

Box = tuple[float, float, float, float]
"""x_low, y_low, x_high, y_high [m]."""

WALL, DOOR = 0.1, 0.9
SLOTS = 4
"""Places of the piece by which rooms differ, the last of them for none."""


def like_rooms(seed: int) -> Floor:
    """Return a corridor with rooms of one size and furniture.

    Rooms differ by where one piece stands; some do not differ.
    """
    generator = np.random.default_rng(seed)
    width, depth = (round(float(generator.uniform(*span)), 1) for span in ((3.0, 3.8), (3.4, 4.4)))
    corridor = round(float(generator.uniform(1.6, 2.2)), 1)
    rooms = int(generator.integers(3, 6))
    furniture = _furniture(width, depth, generator)
    choices = generator.integers(0, SLOTS, 2 * rooms)
    boxes = _walls(rooms, width, depth, corridor)
    for index, slot in enumerate(choices.tolist()):
        pieces = [*furniture[:-SLOTS], furniture[len(furniture) - SLOTS + slot]]
        boxes += [_placed(piece, index, rooms, width, depth, corridor) for piece in pieces if piece[2] > piece[0]]
    bounds = (0.0, 0.0, rooms * width + 2 * WALL, 2 * depth + corridor + 2 * WALL)
    solids = tuple(Solid(np.array([(a, b), (c, b), (c, d), (a, d)], np.float64)) for a, b, c, d in boxes)
    return Floor(f"like_rooms:{seed}", bounds, solids, starts=_starts(rooms, width, depth, corridor, generator))


def _furniture(width: float, depth: float, generator: np.random.Generator) -> list[Box]:
    """Return the pieces of every room, then those of which each room has one.

    X along the corridor, y from it, in a room's frame.
    """
    bed, desk, long = (round(float(generator.uniform(*span)), 2) for span in ((1.8, 2.1), (1.0, 1.4), (1.1, 1.4)))
    common = [
        (WALL / 2, depth - bed, WALL / 2 + 0.9, depth),
        (width - WALL / 2 - desk, depth - 0.6, width - WALL / 2, depth),
    ]
    own = [
        (WALL / 2, 0.7, WALL / 2 + 0.45, min(0.7 + long, depth - bed - 0.1)),
        (width - WALL / 2 - 0.4, 0.9, width - WALL / 2, 0.9 + long),
        (width / 2 - 0.35, depth - 0.5, width / 2 + 0.25, depth),
        (0.0, 0.0, 0.0, 0.0),
    ]
    return common + own


def _placed(piece: Box, index: int, rooms: int, width: float, depth: float, corridor: float) -> Box:
    """Return a piece of a room in the floor's frame. Rooms of the lower side are turned by half a turn."""
    column, is_upper = index % rooms, index >= rooms
    x_low, y_low, x_high, y_high = piece
    left = WALL + column * width
    if is_upper:
        low = WALL + depth + corridor
        return left + x_low, low + y_low, left + x_high, low + y_high
    right, high = left + width, WALL + depth
    return right - x_high, high - y_high, right - x_low, high - y_low


def _walls(rooms: int, width: float, depth: float, corridor: float) -> list[Box]:
    length, height = rooms * width + 2 * WALL, 2 * depth + corridor + 2 * WALL
    boxes = [
        (0.0, 0.0, length, WALL),
        (0.0, height - WALL, length, height),
        (0.0, 0.0, WALL, height),
        (length - WALL, 0.0, length, height),
    ]
    for low in (WALL + depth - WALL, WALL + depth + corridor):
        # One wall along the corridor, with a door in the middle of each room.
        edges = [0.0]
        for room in range(rooms):
            middle = WALL + (room + 0.5) * width
            edges += [middle - DOOR / 2, middle + DOOR / 2]
        edges.append(length)
        boxes += [(edges[k], low, edges[k + 1], low + WALL) for k in range(0, len(edges), 2)]
    for room in range(1, rooms):
        x = WALL + room * width - WALL / 2
        boxes += [(x, 0.0, x + WALL, WALL + depth), (x, WALL + depth + corridor, x + WALL, height)]
    return boxes


def _starts(
    rooms: int, width: float, depth: float, corridor: float, generator: np.random.Generator
) -> NDArray[np.float64]:
    chosen = generator.choice(2 * rooms, 3, replace=False)
    places = [
        (WALL + (room % rooms + 0.5) * width, WALL + 0.5 * depth + (depth + corridor if room >= rooms else 0.0))
        for room in chosen.tolist()
    ]
    return np.asarray(np.round(np.column_stack([places, generator.uniform(-np.pi, np.pi, 3)]), 4), np.float64)


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

    `name`: its name, of letters that a file's name may have; `half`: ``tuning`` or ``test``; `kind`: ``apartment``,
    ``office`` and ``corridors`` are generated, ``like_rooms`` as well; ``drawn``; ``real`` are apartments of LIFULL;
    `seed`: of a generated one; `path`: of a real one; `is_copy`: whether furniture was taken away from the floor of
    that kind and seed.
    """

    name: str
    half: str
    kind: str
    seed: int = 0
    path: Path | None = None
    is_copy: bool = False

    @property
    def original(self) -> str:
        """Name of the floor that it is a copy of; its own if it is none."""
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
    """Return the floors of the bank."""
    floors: list[BankFloor] = []
    for half in HALVES:
        first = _FIRST_SEED[half]
        for kind, count in (
            ("apartment", _APARTMENTS),
            ("office", _OFFICES),
            ("corridors", _CORRIDORS),
            ("like_rooms", _LIKE_ROOMS),
        ):
            floors += [BankFloor(f"{kind}-{seed}", half, kind, seed) for seed in range(first, first + count, every)]
        floors.append(BankFloor(_DRAWN[half], half, "drawn"))
        chosen = [] if data is None else _real_floors(Path(data), *_REAL_M2[half])[:_REAL:every]
        floors += [BankFloor(f"real-{path.stem[:20]}", half, "real", path=path) for path in chosen]
        originals = [floor for floor in floors if floor.half == half and floor.kind in ("apartment", "office")]
        copied = originals[:_COPIED]
        floors += [BankFloor(f"{floor.name}-copy", half, floor.kind, floor.seed, is_copy=True) for floor in copied]
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
        raise ValueError(f"floor {floor.name!r} has no furniture that could be taken away; want one with some")
    generator = np.random.default_rng(seed)
    count = min(int(generator.integers(1, 4)), len(pieces))
    taken = set(generator.choice(pieces, count, replace=False).tolist())
    solids = tuple(solid for index, solid in enumerate(floor.solids) if index not in taken)
    return Floor(f"{floor.name}-copy", floor.bounds, solids, starts=floor.starts)


def _real_floors(data: Path, least_m2: float, most_m2: float) -> list[Path]:
    """Return the files of connected LIFULL apartments of some free area [m2]."""
    import json

    folder = data / "floorplans" / "lifull"
    if not (folder / "meta.json").is_file():
        raise FileNotFoundError(f"no floors of LIFULL below {data}; want {folder.relative_to(data)} there")
    meta = json.loads((folder / "meta.json").read_text())
    areas = {name: one["free_px"] * one["resolution"] ** 2 for name, one in meta.items() if one["conn"] >= _CONNECTED}
    wanted = [name for name, area in areas.items() if least_m2 <= area < most_m2]
    return [folder / "txt" / f"{name}.txt" for name in sorted(wanted) if (folder / "txt" / f"{name}.txt").is_file()]
