"""Trees as files, to be read, drawn and started from.

A file has what robots saw; regions and openings are found again from it. Places are in the frame of the robots'
poses: the floor's if they know their starts, else that of the robot's start.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.agents.srt.safe_region import DIRECTIONS
from lidarium.agents.srt.settings import SHAPES
from lidarium.agents.srt.tree import Node, RegionRules, Tree
from lidarium.mapping.files.guarded_reading import check_file, read_arrays, reading
from lidarium.mapping.files.output import write_arrays

VERSION = 1
MAX_NODES = 100_000
MAX_COORDINATE_M = 1e6
_CLOSED, _TRIED = 1, 2


def write_tree(
    path: Path, nodes: Sequence[Node], rules: Mapping[str, RegionRules], origin: NDArray[np.float64]
) -> None:
    """Write nodes of a tree, whole or not at all.

    Parameters
    ----------
    nodes : sequence of Node
        Nodes, each after its parent; ways to others are left out.
    rules : dict of str to RegionRules
        Rules of each agent; they differ in the radius of the body alone.
    origin : (2,) float64
        Origin of the nodes' frame in that of the file [m].
    """
    places = {node.number: k for k, node in enumerate(nodes)}
    agents, common = sorted({node.agent for node in nodes}), next(iter(rules.values()))
    ways = [
        (places[node.number], places[other])
        for node in nodes
        for other in node.neighbours
        if other in places and node.number < other
    ]
    flags = [_CLOSED * opening.is_closed + _TRIED * opening.is_tried for node in nodes for opening in node.openings]
    arrays: dict[str, Any] = {
        "rules": np.array(
            [VERSION, SHAPES.index(common.shape), common.perception, common.turn_room, common.with_blind]
        ),
        "agents": np.array(agents, np.str_),
        "agent": np.array([agents.index(node.agent) for node in nodes], np.int32),
        "poses": np.array([node.pose for node in nodes]).reshape(-1, 3) + np.append(origin, 0.0),
        "bodies": np.array([rules[node.agent].body for node in nodes], np.float64),
        "parents": np.array(
            [places.get(node.parent, -1) if node.parent is not None else -1 for node in nodes], np.int32
        ),
        "ways": np.array(ways, np.int32).reshape(-1, 2),
        # Ranges are float32 as they come from the laser.
        "views": np.array([node.view for node in nodes], np.float32).reshape(-1, DIRECTIONS),
        "has_turned": np.array([node.has_turned for node in nodes], np.bool_),
        "openings": np.array([len(node.openings) for node in nodes], np.int32),
        "flags": np.array(flags, np.uint8),
    }
    write_arrays(path, arrays)


def read_tree(path: Path, origin: NDArray[np.float64] | None = None) -> Tree:
    """Read a tree that `write_tree` wrote; places are relative to ``origin`` (2,) in the file's frame [m]."""
    check_file(path)
    arrays = read_arrays(path, "a tree")
    with reading(path, "a tree"):
        if not isinstance(arrays, dict):
            raise ValueError("it is a single array")
        return _tree_of(arrays, np.zeros(2) if origin is None else origin)


def _tree_of(arrays: dict[str, NDArray[Any]], origin: NDArray[np.float64]) -> Tree:
    version, shape, perception, turn_room, with_blind = arrays["rules"].tolist()
    if version != VERSION:
        raise ValueError(f"version is {version:g}; want {VERSION}")
    poses, views = arrays["poses"].astype(np.float64), arrays["views"].astype(np.float64)
    count = len(poses)
    _check(arrays, count)
    if not (0 <= shape < len(SHAPES) and perception > 0.0 and 0.0 <= turn_room < MAX_COORDINATE_M):
        raise ValueError(f"its rules are {arrays['rules'].tolist()}; want shape, perception and room of a tree")
    names, tree, flag = arrays["agents"].tolist(), Tree(), 0
    for number in range(count):
        pose, parent = poses[number] - np.append(origin, 0.0), int(arrays["parents"][number])
        rules = RegionRules(
            SHAPES[int(shape)], float(arrays["bodies"][number]), perception, turn_room, bool(with_blind)
        )
        agent = str(names[int(arrays["agent"][number])])
        node = rules.node(number, agent, pose, None if parent < 0 else parent, views[number])
        node.has_turned = bool(arrays["has_turned"][number])
        if len(node.openings) != arrays["openings"][number]:
            raise ValueError(f"node {number} has {len(node.openings)} openings, not {arrays['openings'][number]}")
        for opening in node.openings:
            opening.is_closed, opening.is_tried = (bool(arrays["flags"][flag] & bit) for bit in (_CLOSED, _TRIED))
            flag += 1
        tree.add(node, None, ())
    for node in tree.nodes:
        node.neighbours.clear()  # also a way to a parent may be blocked
    for first, second in arrays["ways"].tolist():
        tree.connect(first, second)
    return tree


def _check(arrays: dict[str, NDArray[Any]], count: int) -> None:
    """Check the arrays of a tree."""
    if count > MAX_NODES:
        raise ValueError(f"it has {count:,} nodes; want at most {MAX_NODES:,}")
    wanted: dict[str, tuple[int, ...]] = {
        "poses": (count, 3),
        "views": (count, DIRECTIONS),
        "ways": (len(arrays["ways"]), 2),
    }
    wanted |= dict.fromkeys(("agent", "bodies", "parents", "has_turned", "openings"), (count,))
    for name, shape in wanted.items():
        if arrays[name].shape != shape:
            raise ValueError(f"its {name} have shape {arrays[name].shape}; want {shape}")
    if not (np.isfinite(arrays["poses"]).all() and np.abs(arrays["poses"][:, :2]).max(initial=0.0) < MAX_COORDINATE_M):
        raise ValueError(f"its poses are not all finite, and less than {MAX_COORDINATE_M:g} m away")
    if not ((arrays["bodies"] > 0.0) & (arrays["bodies"] < MAX_COORDINATE_M)).all():
        raise ValueError("its bodies are not all above 0 m")
    if (arrays["views"] < 0.0).any():
        raise ValueError("its views have ranges below 0 m")
    if not (arrays["parents"] < np.arange(count)).all():
        raise ValueError("a node comes before its parent")
    for name, limit in (("agent", len(arrays["agents"])), ("ways", count)):
        if not ((arrays[name] >= 0) & (arrays[name] < limit)).all():
            raise ValueError(f"its {name} have numbers of none; want 0 to {limit - 1}")
    if arrays["flags"].shape != (int(arrays["openings"].sum()),):
        raise ValueError(f"it has {len(arrays['flags'])} flags for {int(arrays['openings'].sum())} openings")
