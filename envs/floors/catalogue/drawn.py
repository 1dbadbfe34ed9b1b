"""Drawn floors: our own plans as short JSON files in `data/`.

A file has some of these keys, in metres and degrees::

    {
      "name": "apartment",
      "about": "one sentence",
      "bounds": [0, 0, 11, 8],                 the outer walls' outer faces
      "outer_wall": 0.2,                       their thickness, inside of the bounds
      "walls": [[0, 4, 8, 4, 0.2]],            middle line x, y, x, y; thickness; 0.1 by default
      "doors": [[6, 4, 1.2]],                  middle of the gap; its width; 0.9 by default
      "blocks": [[3, 3, 5, 4]],                solid rectangles x, y, x, y
      "rooms": [[[0, 0], [3, 0], [3, 9]]],     outlines of free space; all else is solid, no outer walls
      "obstacles": [{"corners": [[1, 1], [2, 1], [2, 2]], "height": 1.2}],
      "wall_height": 2.5,                      of walls, blocks and the surroundings of rooms
      "ceiling": 2.5,                          top of solids without a height
      "furniture": [["bed", 2, 7, 90, 1.6, 2.0]],    kind, middle, direction of its back; width, depth
      "starts": [[1, 1, 0]],                   x, y, heading
      "goal": [7, 7]
    }

A door cuts every wall that passes through its middle.
"""

import json
import math
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from lidarium.envs.floors.drawing import strip
from lidarium.envs.floors.floor import CEILING, Floor, Solid, check_pairs
from lidarium.envs.floors.generation.furniture import place
from lidarium.mapping.files.guarded_reading import printable, read_text, reading

MAX_JSON_BYTES = 1 << 20
DATA = Path(__file__).parent / "data"
INNER_WALL = 0.1
DOOR_WIDTH = 0.9


@lru_cache(maxsize=1)  # it is asked for each floor that an episode draws
def drawn_names() -> tuple[str, ...]:
    """Names of the drawn floors, in alphabetical order."""
    return tuple(sorted(path.stem for path in DATA.glob("*.json") if not path.stem.startswith("_")))


def about_drawn(name: str) -> str:
    """Return one sentence that describes a drawn floor."""
    return str(json.loads((DATA / f"{name}.json").read_text(encoding="utf-8"))["about"])


def load_drawn(path: Path) -> Floor:
    """Read a drawn floor."""
    text = read_text(path, MAX_JSON_BYTES)
    with reading(path, "a drawn floor"):
        plan = json.loads(text)
        bounds = tuple(float(value) for value in plan["bounds"])
        if len(bounds) != 4:
            raise ValueError(f"bounds are {plan['bounds']}; want x, y, x, y")
        height = float(plan.get("wall_height", math.inf))
        rooms = tuple(np.array(room, dtype=np.float64) for room in plan.get("rooms", []))
        if rooms:
            solids = [replace(_rectangle(*bounds), holes=rooms)]
        else:
            solids = [*_outer_walls(bounds, float(plan.get("outer_wall", 0.2)))]
        check_pairs(str(path), len(plan.get("walls", [])), len(plan.get("doors", [])))
        for wall in plan.get("walls", []):
            solids += _wall(wall, plan.get("doors", []))
        solids += [_rectangle(*block) for block in plan.get("blocks", [])]
        solids = [replace(solid, z_high=height) for solid in solids]
        for obstacle in plan.get("obstacles", []):
            solids.append(
                Solid(
                    np.array(obstacle["corners"], dtype=np.float64),
                    z_high=float(obstacle.get("height", math.inf)),
                )
            )
        for kind, x, y, degrees, *size in plan.get("furniture", []):
            solids += place(kind, x, y, math.radians(degrees), *size)
        starts = [(x, y, math.radians(degrees)) for x, y, degrees in plan.get("starts", [])]
        goal = plan.get("goal")
        return Floor(
            printable(str(plan["name"])),
            bounds,
            tuple(solids),
            None,
            np.array(starts).reshape(-1, 3),
            None if goal is None else (goal[0], goal[1]),
            float(plan.get("ceiling", CEILING)),
            height,
        )


def _wall(wall: list[float], doors: list[list[float]]) -> list[Solid]:
    """Build a straight wall less the doors in it.

    It is half its thickness longer at both ends so that corners close.
    """
    start, end = np.array(wall[:2], dtype=np.float64), np.array(wall[2:4], dtype=np.float64)
    thickness = wall[4] if len(wall) > 4 else INNER_WALL
    length = math.hypot(*(end - start))
    along = (end - start) / length
    edges = [-thickness / 2]
    for door in sorted(doors, key=lambda door: float(along @ (np.array(door[:2]) - start))):
        offset = np.array(door[:2]) - start
        middle, half = float(along @ offset), (door[2] if len(door) > 2 else DOOR_WIDTH) / 2
        if abs(float(along[0] * offset[1] - along[1] * offset[0])) < thickness / 2 and 0.0 < middle < length:
            edges += [middle - half, middle + half]
    edges.append(length + thickness / 2)
    pieces = [(edges[k], edges[k + 1]) for k in range(0, len(edges), 2) if edges[k + 1] > edges[k]]
    ends = [np.concatenate([start + along * low, start + along * high]) for low, high in pieces]
    return [Solid(np.round(strip(piece, thickness), 4) + 0.0) for piece in ends]


def _outer_walls(bounds: tuple[float, ...], thickness: float) -> list[Solid]:
    x_low, y_low, x_high, y_high = bounds
    return [
        _rectangle(x_low, y_low, x_high, y_low + thickness),
        _rectangle(x_low, y_high - thickness, x_high, y_high),
        _rectangle(x_low, y_low + thickness, x_low + thickness, y_high - thickness),
        _rectangle(x_high - thickness, y_low + thickness, x_high, y_high - thickness),
    ]


def _rectangle(x_low: float, y_low: float, x_high: float, y_high: float) -> Solid:
    return Solid(np.array([(x_low, y_low), (x_high, y_low), (x_high, y_high), (x_low, y_high)], dtype=np.float64))
