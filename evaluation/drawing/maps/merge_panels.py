"""What a picture of a merge shows: maps laid over each other, rigidly or bent, and what contradicts."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.files.guarded_reading import shortened
from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.grids.occupancy import FREE, OCCUPIED, UNKNOWN
from lidarium.mapping.merging.bend.deforming import Deformed, Laid
from lidarium.mapping.merging.joining.merged_maps import Merged

MOST_PANELS = 6
"""Most panels of a picture."""

MISS_M = 0.15
"""A wall contradicts where all within this distance is free [m]."""

_MOST_TITLE = 60


@dataclass(frozen=True, slots=True, eq=False)
class Panel:
    """Maps that are drawn over each other.

    Attributes
    ----------
    names : list of str
        The maps, that in whose frame is drawn first.
    layers : list of Laid
        Each map as it is laid in the cells of that frame, bent where it was.
    title : str
        What is to be said of them.
    matched : list of (n, 2, 2) float64
        Matched corners of pairs of them, in the first map's frame [m].
    """

    names: list[str]
    layers: list[Laid]
    title: str
    matched: list[NDArray[np.float64]]


def panels_of(merged: Merged, deformed: Sequence[Deformed] = ()) -> list[Panel]:
    """Return what is drawn: joined groups, and refused pairs of maps that join none, else the maps alone.

    Parameters
    ----------
    merged : Merged
        The maps.
    deformed : sequence of Deformed
        Of each group of two maps or more how it was bent, in the order of the groups; empty where none was.
    """
    known = {name for name, levels in merged.levels.items() if (levels != UNKNOWN).any()}
    groups = [group for group in merged.groups() if len(group) > 1]
    if deformed:
        panels = [_bent_panel(merged, *each) for each in zip(groups, deformed, strict=True)]
    else:
        panels = [_group_panel(merged, group) for group in groups]
    joined = {name for panel in panels for name in panel.names}
    for (a, b), result in merged.pairs.items():
        is_refused = {a, b} <= known and not {a, b} <= joined
        if len(panels) < MOST_PANELS and is_refused and result.a_from_b is not None:
            title = f"refused, {shortened(result.reason, _MOST_TITLE)}"
            layers = [Laid(merged.levels[a], Transform()), Laid(merged.levels[b], result.a_from_b)]
            panels.append(Panel([a, b], layers, title, []))
    return panels or [
        Panel([name], [Laid(merged.levels[name], Transform())], "joins none", [])
        for name in sorted(known)[:MOST_PANELS]
    ]


def contradicting(layers: Sequence[Laid], resolution: float) -> NDArray[np.float64]:
    """Return the walls that stand where another map is free, in the common frame (n, 2) [m].

    Parameters
    ----------
    layers : sequence of Laid
        Maps as they are laid.
    resolution : float
        Side of their cells [m].
    """
    found = [
        one.common_from_cells.apply(_against(one, other, resolution))
        for one in layers
        for other in layers
        if one is not other
    ]
    return np.concatenate(found) if found else np.zeros((0, 2))


def _group_panel(merged: Merged, group: list[str]) -> Panel:
    """Return a group as its maps were joined."""
    layers = [Laid(merged.levels[name], merged.tree.lookup(group[0], name) or Transform()) for name in group]
    matched, walls_m = [], 0.0
    for (a, b), result in merged.pairs.items():
        if result.is_accepted and a in group and b in group:
            ends = [
                layers[group.index(name)].common_from_cells.apply(points)
                for name, points in zip((a, b), result.joined, strict=True)
            ]
            matched.append(np.stack(ends, axis=1))
            walls_m += result.agreement.agreeing_m
    title = f"{walls_m:.0f} m of walls agree, {sum(map(len, matched))} matched corners"
    return Panel(group, layers, title, matched)


def _bent_panel(merged: Merged, group: list[str], deformed: Deformed) -> Panel:
    """Return a group as its maps were bent; matched corners move with them."""
    bent = [one for one in deformed.deformations if one is not None]
    if not bent:
        return _group_panel(merged, group)
    matched = []
    for (a, b), result in merged.pairs.items():
        if result.is_accepted and a in group and b in group:
            ends = [
                deformed.places(group.index(name), points)
                for name, points in zip((a, b), result.joined, strict=True)
            ]
            matched.append(np.stack(ends, axis=1))
    walls_m, most_m = sum(one.agreement.agreeing_m for one in bent), max(one.most_m for one in bent)
    title = f"bent by {most_m:.2f} m at most, {walls_m:.0f} m of walls agree then"
    return Panel(group, deformed.laid, title, matched)


def _against(one: Laid, other: Laid, resolution: float) -> NDArray[np.float64]:
    """Return the walls of a map that stand where another one is free, in its own metres (n, 2)."""
    walls = np.argwhere(one.levels == OCCUPIED)[:, ::-1] + 0.5
    other_from_one = other.common_from_cells.inverse() @ one.common_from_cells
    cells = np.floor(other_from_one.apply(walls * resolution) / resolution).astype(np.int64)
    rows, columns = other.levels.shape
    is_on = (cells >= 0).all(axis=1) & (cells[:, 0] < columns) & (cells[:, 1] < rows)
    walls, cells = walls[is_on], cells[is_on]
    clear = cv2.distanceTransform((other.levels == FREE).astype(np.uint8), cv2.DIST_L2, 5)
    reach = max(MISS_M / resolution, 1.5)
    return np.asarray(walls[clear[cells[:, 1], cells[:, 0]] > reach] * resolution)
