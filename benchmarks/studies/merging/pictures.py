"""Pictures of pairs of the bank, laid over each other."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from lidarium.benchmarks.studies.merging.bank.bank import BankMap, Pair
from lidarium.benchmarks.studies.merging.bank.drives import RESOLUTION
from lidarium.benchmarks.studies.merging.trials import Outcome
from lidarium.mapping.files.output import whole_file
from lidarium.mapping.grids.occupancy import FREE, OCCUPIED
from lidarium.mapping.merging.fusion import FusedMap, fuse

FIRST, SECOND, BOTH = (
    np.array(colour, np.float64) for colour in ((37, 99, 235), (234, 88, 12), (31, 41, 55))
)


def draw_pairs(path: Path, maps: dict[str, BankMap], pairs: list[Pair], outcomes: list[Outcome]) -> None:
    """Draw five pairs of maps, overlaid as they truly lie.

    Two are joined, one is missed, one is a look-alike and one is symmetric.
    """
    chosen = _chosen(pairs, outcomes)
    figure = Figure(figsize=(3.4 * len(chosen), 4.4), dpi=110, layout="constrained")
    FigureCanvasAgg(figure)
    for axes, (title, pair) in zip(figure.subplots(1, len(chosen), squeeze=False)[0], chosen, strict=True):
        _draw(axes, title, maps[pair.a], maps[pair.b])
    with whole_file(path) as beside:
        figure.savefig(beside, bbox_inches="tight", pad_inches=0.15)


def _chosen(pairs: list[Pair], outcomes: list[Outcome]) -> list[tuple[str, Pair]]:
    both = list(zip(pairs, outcomes, strict=True))
    wanted: tuple[tuple[str, Callable[[Pair, Outcome], bool]], ...] = (
        (
            "joined by corners",
            lambda pair, one: pair.category == "positive" and one.is_accepted and one.found_by == "corners",
        ),
        (
            "joined by correlation, little overlap",
            lambda pair, one: pair.category == "positive" and one.is_accepted and pair.overlap < 0.3,
        ),
        (
            "missed: little overlap",
            lambda pair, one: pair.category == "positive" and not one.is_accepted and pair.overlap < 0.3,
        ),
        (
            "look-alike, refused",
            lambda pair, one: pair.category == "look_alike" and not one.is_accepted,
        ),
        (
            "furniture taken away, joined",
            lambda pair, one: pair.category == "refurnished" and pair.differing_m > 2.0 and one.is_accepted,
        ),
        ("symmetric, refused", lambda pair, one: pair.category == "symmetric" and not one.is_accepted),
    )
    found = [
        (title, next((pair for pair, one in both if is_wanted(pair, one)), None))
        for title, is_wanted in wanted
    ]
    return [(title, pair) for title, pair in found if pair is not None] or [
        (pair.category, pair) for pair in pairs[:1]
    ]


def _draw(axes: Axes, title: str, a: BankMap, b: BankMap) -> None:
    fused = fuse([a.levels, b.levels], [a.floor_from_map, b.floor_from_map], RESOLUTION)
    axes.imshow(_coloured(fused), origin="lower", interpolation="nearest")
    axes.set_title(title, fontsize=10)
    axes.set_xlabel(f"{a.key}\n{b.key}", fontsize=8)
    axes.set_xticks([])
    axes.set_yticks([])


def _coloured(fused: FusedMap) -> NDArray[np.uint8]:
    """Return walls and free space coloured by which map knows them.

    The shape is (rows, columns, 3).
    """
    sources = fused.sources.astype(np.int64)
    picture = np.full((*sources.shape, 3), 240.0)
    for bits, colour in ((1, FIRST), (2, SECOND), (3, BOTH)):
        is_seen = sources == bits
        picture[is_seen & (fused.levels == FREE)] = 255.0 - 0.15 * (255.0 - colour)
        picture[is_seen & (fused.levels == OCCUPIED)] = colour
    return picture.astype(np.uint8)
