"""Furnishing: pieces against the walls of rooms or free-standing in them.

Doors and passages are kept clear.

Rooms get their main pieces first (bed, sofa, desks), then more and more small ones, until the wanted share of
the floor is covered. Two pieces stand side by side along one wall or leave room for a robot between them,
nothing in between.
"""

import numpy as np

from lidarium.envs.floors.generation.furniture import PIECES
from lidarium.envs.floors.generation.furniture_places import Furnished, FurniturePlaces
from lidarium.envs.floors.generation.plans import Door, Labels, room_areas
from lidarium.envs.floors.generation.room_wishes import room_wishes

SMALLEST_M2 = 0.1
"""Furnishing ends when less than this is left to cover [m²]."""

FULL = 4
"""Pieces in a row without a place after which a room counts as full."""


def furnish(
    kind: str,
    labels: Labels,
    doors: list[Door],
    clutter: float,
    wall_thickness: float,
    generator: np.random.Generator,
) -> list[Furnished]:
    """Furniture for all rooms of a plan, main pieces first.

    Parameters
    ----------
    kind : str
        "apartment", "office" or "corridors".
    labels : (rows, columns) int32
        The plan.
    doors : list of Door
        What to keep clear.
    clutter : float
        Share of the area of the rooms to cover.
    wall_thickness : float
        Of the walls between rooms [m].
    generator : np.random.Generator
        Source of all draws.

    Returns
    -------
    list of Furnished
        In the order in which they were placed.
    """
    areas = room_areas(labels)
    wishes = room_wishes(kind, areas, generator)
    places = FurniturePlaces(labels, doors, wall_thickness)
    budget = clutter * float(areas.sum())
    placed: list[Furnished] = []
    misses = [0] * len(wishes)
    for turn in range(2 * max(len(wish) for wish in wishes)):
        for room in generator.permutation(len(wishes)):
            if areas[room] == 0.0 or budget < SMALLEST_M2 or misses[room] == FULL:
                continue
            first, rest = wishes[room][: len(wishes[room]) // 2], wishes[room][len(wishes[room]) // 2 :]
            name = first[turn] if turn < len(first) else rest[(turn - len(first)) % len(rest)]
            width, depth = (
                round(generator.uniform(*span) / 0.05) * 0.05
                for span in (PIECES[name].width, PIECES[name].depth)
            )
            if width * depth / 2 > budget:
                continue
            found = places.draw(int(room), name, width, depth, generator)
            misses[room] = 0 if found is not None else misses[room] + 1
            if found is not None:
                placed.append(found)
                budget -= width * depth
    return placed
