"""What each room of a building would like to hold, by its use."""

import numpy as np
from numpy.typing import NDArray

APARTMENT = {
    "living": (
        "sofa",
        "low table",
        "shelf",
        "dining table",
        "cabinet",
        "armchair",
        "shelf",
        "plant",
        "cabinet",
        "chair",
    ),
    "bedroom": (
        "bed",
        "wardrobe",
        "cabinet",
        "nightstand",
        "desk",
        "shelf",
        "armchair",
        "plant",
        "box",
        "shelf",
        "box",
    ),
    "child": ("single bed", "desk", "wardrobe", "shelf", "cabinet", "box", "box", "shelf", "box"),
    "kitchen": ("counter", "fridge", "table", "counter", "cabinet", "chair", "chair", "shelf"),
    "bath": ("bathtub", "toilet", "basin", "cabinet", "box"),
    "store": ("shelf", "box", "shelf", "box", "cabinet", "box"),
    "hall": ("shelf", "cabinet", "bench", "plant"),
}
OFFICE = {
    "office": (
        "desk",
        "shelf",
        "desk",
        "cabinet",
        "wardrobe",
        "desk",
        "plant",
        "shelf",
        "chair",
        "cabinet",
        "box",
        "shelf",
    ),
    "open office": (
        "desk group",
        "desk pair",
        "shelf",
        "desk",
        "cabinet",
        "desk",
        "shelf",
        "wardrobe",
        "plant",
        "cabinet",
        "desk",
    ),
    "meeting": ("meeting table", "cabinet", "shelf", "plant", "chair", "cabinet", "box", "chair"),
    "washroom": ("toilet", "basin", "toilet", "cabinet"),
    "store": ("shelf", "shelf", "box", "cabinet", "box", "shelf"),
    "hall": (
        "seats",
        "plant",
        "cabinet",
        "bench",
        "shelf",
        "cabinet",
        "sofa",
        "bench",
        "plant",
        "seats",
        "shelf",
    ),
}
CORRIDORS = {
    "hall": ("cabinet", "bench", "shelf", "plant", "box", "cabinet", "shelf", "seats", "box", "bench") * 4
}


def room_wishes(
    kind: str, areas: NDArray[np.float64], generator: np.random.Generator
) -> list[tuple[str, ...]]:
    """List the pieces that each room would like to hold, by label, from its use.

    Parameters
    ----------
    kind : str
        "apartment", "office" or "corridors".
    areas : (rooms,) float64
        Of the rooms [m²]; their use follows from these.
    generator : np.random.Generator
        Where the use of the rooms of an office is drawn from.
    """
    if kind == "corridors":
        return [CORRIDORS["hall"]]
    if kind == "office":
        uses = ["hall"] + [_office_use(area, generator.random()) for area in areas[1:]]
        return [OFFICE[use] * (3 if use == "hall" else 1) for use in uses]
    rooms = [int(room) for room in np.argsort(areas[1:], kind="stable") + 1]
    uses = ["hall"] + ["child"] * len(rooms)
    for room in rooms:
        uses[room] = "store" if areas[room] < 5.5 else "child" if areas[room] < 11.0 else "bedroom"
    uses[rooms[0]] = "bath"
    if len(rooms) > 3:
        uses[rooms[1]] = "bath" if areas[rooms[1]] < 4.5 and len(rooms) > 5 else "kitchen"
        uses[rooms[2]] = "kitchen" if uses[rooms[1]] == "bath" else uses[rooms[2]]
    if len(rooms) > 1:
        uses[rooms[-1]] = "living"
    return [APARTMENT[use] for use in uses]


def _office_use(area: float, draw: float) -> str:
    if area < 7.0:
        return "washroom" if draw < 0.5 else "store"
    if area < 16.0:
        return "office" if draw < 0.85 else "store"
    return "meeting" if draw < 0.3 else "office" if area < 22.0 else "open office"
