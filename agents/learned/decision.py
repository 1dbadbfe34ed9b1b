"""A decision of one robot: its options, their features, and their ranks by classic tours."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from lidarium.agents.learned.features import (
    OPTION_FEATURES,
    SITUATION_FEATURES,
    TEAMMATE_FEATURES,
    far_gains,
    option_features,
    table_of,
    teammate_features,
)
from lidarium.agents.predicted.planning import LEAST_EXTRA
from lidarium.agents.tours.planning import TourOptions
from lidarium.envs.onboard.navigation import NavigationMap
from lidarium.mapping.planning.grid_planning import centres_of
from lidarium.mapping.planning.touring.map_crops import OCCUPIED, UNKNOWN, map_crops
from lidarium.mapping.planning.touring.map_tours import NO_PATH
from lidarium.mapping.planning.touring.tours import TourWeights, costs_of_firsts

CROP_SIDE, CROP_STEP = 24, 0.25
"""Squares a side of the crop around each option, and the side of a square [m]."""

MAX_DETOUR = 50.0
"""Longer detours count as this one [m]."""


@dataclass(frozen=True, slots=True)
class Decision:
    """The n options of one robot, and their features.

    Attributes
    ----------
    options : (n, len(OPTION_FEATURES)) float32
        Features of each option.
    crops : (n, CROP_SIDE, CROP_SIDE) int8
        The map around each option, see ``map_crops``.
    teammates : (m, len(TEAMMATE_FEATURES)) float32
        Features of each teammate.
    situation : (len(SITUATION_FEATURES),) float32
        Features of the situation.
    scores : (n,) float32
        Ranks by classic tours, or by those on a predicted map: minus the extra cost [m], 0 for the option that they
        begin with.
    mask : (n,) bool
        The options that it can reach and that no robot has picked just before.
    """

    options: NDArray[np.float32]
    crops: NDArray[np.int8]
    teammates: NDArray[np.float32]
    situation: NDArray[np.float32]
    scores: NDArray[np.float32]
    mask: NDArray[np.bool_]

    @property
    def classic(self) -> int:
        """The option with which tours begin."""
        return int(np.argmax(np.where(self.mask, self.scores, -np.inf)))


class Chooser(Protocol):
    """Chooses an option."""

    def __call__(self, decision: Decision) -> int:
        """Return the number of an option that the mask allows."""
        ...


def choose_classic(decision: Decision) -> int:
    """Choose the option that tours begin with."""
    return decision.classic


@dataclass(frozen=True, slots=True)
class Scene:
    """Data shared by the decisions of all robots on one map.

    Attributes
    ----------
    options : TourOptions
        The robots' options.
    resolution : float
        Side of the map's cells [m].
    crops : (n, CROP_SIDE, CROP_SIDE) int8
        The map around each option.
    views : (n, 2), (n,) float64
        Positions of the views [m], and the directions to the space that they show [rad].
    shared : dict of (n,) float64
        Features of the options that are the same for all robots.
    situation : dict of float
        Features of the situation that are.
    weights : TourWeights
        Weights of tours.
    """

    options: TourOptions
    resolution: float
    crops: NDArray[np.int8]
    views: tuple[NDArray[np.float64], NDArray[np.float64]]
    shared: dict[str, NDArray[np.float64]]
    situation: dict[str, float]
    weights: TourWeights


def scene_of(
    options: TourOptions,
    navigation: NavigationMap,
    reach: float,
    weights: TourWeights,
    progress: dict[str, float],
) -> Scene:
    """Return the data shared by the decisions of all robots on one map.

    Parameters
    ----------
    options : TourOptions
        The robots' options.
    navigation : NavigationMap
        The map.
    reach : float
        How far the lasers see [m].
    weights : TourWeights
        Weights of tours.
    progress : dict of float
        ``time``, ``known`` and ``rate``, see ``SITUATION_FEATURES``.
    """
    log_odds, resolution = navigation.log_odds, navigation.resolution
    cells = options.cells
    gains, directions = far_gains(log_odds, resolution, cells, reach)
    crops = map_crops(log_odds, resolution, cells, directions, CROP_SIDE, CROP_STEP)
    positions = np.asarray(centres_of(cells, (0.0, 0.0), resolution), np.float64)
    sizes = [len(options.cells_of(k)) * resolution for k in range(len(cells))]
    rows, columns = options.grid.shape
    rim = np.minimum(options.places, np.array([rows, columns]) - 1 - options.places).min(axis=1)
    shared = {
        "far_gain": gains,
        "size": np.array(sizes),
        "unknown": (crops == UNKNOWN).mean(axis=(1, 2)),
        "occupied": (crops == OCCUPIED).mean(axis=(1, 2)),
        "rim": rim * options.grid.side,
    }
    situation = {
        **progress,
        "options": float(len(cells)),
        "gain": float(options.gains.sum()),
        "robots": float(len(options.robots)),
    }
    return Scene(options, resolution, crops, (positions, directions), shared, situation, weights)


def decision_of(
    scene: Scene,
    robot: int,
    sequence: NDArray[np.int64],
    picks: Sequence[int | None],
    extra: NDArray[np.float64] | None = None,
) -> Decision | None:
    """Return the decision of a robot, None if its tour is empty.

    Parameters
    ----------
    scene : Scene
        Data shared with the other robots.
    robot : int
        Which robot.
    sequence : (n + robots - 1,) int64
        The tours, given the picks of others.
    picks : sequence of int or None
        Picks of the robots before it.
    extra : (n,) float64, optional
        Extra costs of the options by a predicted map [m]; by default those of tours past known frontiers.
    """
    options = scene.options
    tours = _tours_in(sequence, len(options.numbers))
    if not tours[robot] or not options.is_reached[robot, tours[robot][0]]:
        return None
    first = tours[robot][0]
    if extra is None:
        costs = costs_of_firsts(sequence, robot, options.first, options.between, options.gains, scene.weights)
        costs = np.clip(costs, LEAST_EXTRA, MAX_DETOUR)
        costs[first] = 0.0
    else:
        costs = np.minimum(extra, MAX_DETOUR)
    mask = options.is_reached[robot].copy()
    mask[[pick for pick in picks if pick is not None]] = False
    own = option_features(options, robot, costs, tours[robot], scene.views)
    lengths = [_length(options, k, tour) for k, tour in enumerate(tours)]
    situation = {
        **scene.situation,
        "own_tour": lengths[robot],
        "all_tours": sum(lengths),
        "picked": float(len(picks)),
    }
    others = [
        (other, _target_of(scene, k, picks), k < len(picks)) for k, other in enumerate(options.robots) if k != robot
    ]
    return Decision(
        table_of({**scene.shared, **own}, OPTION_FEATURES),
        scene.crops,
        table_of(teammate_features(others, options.robots[robot].pose), TEAMMATE_FEATURES),
        table_of({name: np.array(value) for name, value in situation.items()}, SITUATION_FEATURES),
        (-costs).astype(np.float32),
        mask,
    )


def _tours_in(sequence: NDArray[np.int64], count: int) -> list[list[int]]:
    """Return each robot's tour of a sequence past ``count`` places.

    The sequence is that of ``team_tours``.
    """
    tours: list[list[int]] = [[]]
    for number in sequence:
        if number >= count:
            tours.append([])
        else:
            tours[-1].append(int(number))
    return tours


def _length(options: TourOptions, robot: int, tour: list[int]) -> float:
    """Return the length of a tour, as far as there are paths [m]."""
    if not tour:
        return 0.0
    legs = [options.lengths[robot, tour[0]], *options.between[tour[:-1], tour[1:]]]
    return float(sum(leg for leg in legs if leg < NO_PATH))


def _target_of(scene: Scene, robot: int, picks: Sequence[int | None]) -> NDArray[np.float64] | None:
    """Return the position that a robot has picked, or else drives to [m]."""
    pick = picks[robot] if robot < len(picks) else None
    if pick is not None:
        return np.asarray(scene.views[0][pick])
    kept = scene.options.robots[robot].kept_cell
    return None if kept is None else (np.array([kept[1], kept[0]]) + 0.5) * scene.resolution
