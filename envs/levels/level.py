"""The base class of action levels."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from typing import Any, ClassVar, NamedTuple

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from lidarium.envs.onboard.driving.drives import Drives, Following, no_drives
from lidarium.envs.onboard.driving.safety_stop import FORESIGHT_TIMES
from lidarium.envs.onboard.driving.team_driver import TeamDriver
from lidarium.envs.onboard.perception import Perception
from lidarium.envs.onboard.station.operating import Operating
from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.mapping.geometry.bounds import shown

WAITS, SENSES, STEPS, DECIDES = range(4)
"""Modes of an episode in a run.

It does nothing, takes the scan at the start, takes one step by the commands, or follows the robots' paths up to the
end of a decision.
"""

Mask = NDArray[np.bool_]
"""Which rows are meant, (rows,)."""


class Turn(NamedTuple):
    """The rows of a run, and the outputs of a level that control the run.

    Attributes
    ----------
    acting : (rows,) bool
        Live robots of the episodes that run.
    given : (rows,) bool
        Those of them that decide now; the others continue with their last orders.
    commands : (rows, 2) float64
        Speeds and turn rates for episodes that take one step [m/s, rad/s]; written by the level.
    modes : (episodes,) int8
        Mode of each episode: ``STEPS`` if it runs, which the level may change to ``DECIDES``.
    operating : Operating
        The operating states and orders of all robots.
    """

    acting: Mask
    given: Mask
    commands: NDArray[np.float64]
    modes: NDArray[np.int8]
    operating: Operating


class Level(ABC):
    """A type of action of the robots, and its conversion to motion; row = episode * robots + robot.

    A subclass has an ``action_space`` and decodes actions in `read_rows`; `carry_out` turns them into motion.

    Parameters
    ----------
    perception : Perception
        The beliefs of the robots.
    settings : ExplorationSettings
        The team of every episode.
    shares_map : bool, optional
        Whether robots plan on the team's map, if it reaches them. True by default.
    decision_period_s : float, optional
        Longest time of a decision [s]. That of the settings by default.

    Attributes
    ----------
    action_space : Space
        Action space of one robot.
    boxes : dict
        Spaces of the observations that the level adds.
    period_s : float
        Longest time of a decision, or of a step if the level decides at each step [s].
    steps : int
        The same in steps.
    driver : TeamDriver or None
        Drives robots to targets, if the level has targets.
    drives, following : Drives, Following
        Drives that kernels follow during a decision.
    """

    takes_none: bool = False
    """Whether None is an action; otherwise it counts as a missing one."""

    carries: ClassVar[frozenset[str]] = frozenset()
    """Levels of policies of which it takes the actions, besides its own."""

    observes: ClassVar[bool] = True
    """Whether `observe` does anything."""

    passed_over: NDArray[np.int64] | None = None
    """Steps of time that each episode has passed over in the last decision, if the level may do that."""

    action_space: spaces.Space[Any]
    driver: TeamDriver | None = None
    drives: Drives
    following: Following

    def __init__(
        self,
        perception: Perception,
        settings: ExplorationSettings,
        shares_map: bool = True,
        decision_period_s: float | None = None,
    ) -> None:
        del shares_map, decision_period_s
        self.perception = perception
        self.settings = settings
        self.rows = settings.robots * perception.world.episodes
        self.boxes: dict[str, spaces.Space[Any]] = {}
        self.period_s = settings.time_step
        self.steps = 1
        self.drives = no_drives(1)
        self.following = Following(
            settings.lidar.unit_vectors[None],
            np.zeros(1),
            np.zeros(4),
            False,
            np.zeros((1, 1), np.uint8),
            np.zeros((1, 3)),
            np.zeros(1, np.uint8),
            FORESIGHT_TIMES,
            perception.simulation.safety,
        )

    make_driver: Callable[[], TeamDriver] | None = None
    """Makes the driver when a robot first has a target, if the level has none before."""

    def start(self, episode: int) -> None:  # noqa: B027
        """Begin an episode."""

    def may_rest(self, episode: int) -> bool:
        """Whether None is now an action of the robots of an episode."""
        del episode
        return self.takes_none

    def read(self, actions: Mapping[int, Any], names: list[str]) -> Any:  # noqa: ANN401
        """Decode actions by row; ``names`` are the agents of a team, for messages.

        By default they are combined in an array and passed to `read_rows`.
        """
        space, chosen = self.action_space, np.zeros(self.rows, np.bool_)
        values = np.zeros((self.rows, *(space.shape or ())), space.dtype)
        for row, action in actions.items():
            if not space.contains(action) and not _is_same_in(space, action):
                raise ValueError(f"action of {names[row % len(names)]} is {shown(action)}; want one of {space}")
            values[row] = action
            chosen[row] = True
        return self.read_rows(values, chosen)

    def reads_rows_as(self, kind: type["Level"]) -> bool:
        """Whether actions are read as by a class; otherwise a subclass reads them, all as its `read_rows` does."""
        return type(self).read_rows is kind.read_rows

    @abstractmethod
    def read_rows(self, actions: Any, live: Mask) -> Any:  # noqa: ANN401
        """Decode an array of actions, one for each row; those of rows that are not live mean nothing."""

    @abstractmethod
    def carry_out(self, decoded: Any, turn: Turn) -> None:  # noqa: ANN401
        """Turn decoded actions into speeds or orders, and choose how episodes run."""

    def observe(  # noqa: B027
        self, acted: Mask, live: Mask, seen: Mask, out: dict[str, NDArray[Any]], infos: dict[str, Any]
    ) -> None:
        """Write the observations and infos of the level, after the episodes have run.

        ``acted`` took part in the step, ``live`` are those of ``seen`` that have not ended, ``seen`` are the rows
        that are observed.
        """


def _is_same_in(space: spaces.Space[Any], action: Any) -> bool:  # noqa: ANN401
    """Whether an action of another type of number, such as a list of float64, is in a space."""
    try:
        given = np.asarray(action)
    except ValueError:  # rows of different lengths
        return False
    if given.dtype.kind not in "iuf":
        return False
    cast = given.astype(space.dtype)
    is_whole = np.issubdtype(space.dtype, np.integer)
    return bool((not is_whole or np.array_equal(cast, given)) and space.contains(cast))


def check_rows(actions: Any, shape: tuple[int, ...], live: Mask, wanted: str) -> NDArray[Any]:  # noqa: ANN401
    """Return actions as an array of a shape, finite for live rows.

    Raises
    ------
    ValueError
        If these are not numbers, the shape is another, or a live row's action is not finite.
    """
    try:
        array = np.asarray(actions)
    except ValueError as error:  # rows of different lengths
        raise ValueError(f"actions are {actions!r}; want an array {shape}: {wanted} for each row") from error
    if array.shape != shape:
        raise ValueError(
            f"actions have shape {array.shape}; want {shape}: {wanted} for each row, row = episode * robots + robot"
        )
    if array.dtype.kind not in "biuf":
        raise ValueError(f"actions are of type {array.dtype}; want {wanted} for each row")
    is_finite = np.isfinite(array)
    if is_finite.all():
        return array
    bad = np.flatnonzero(live & ~is_finite.reshape(len(array), -1).all(axis=1))
    if len(bad):
        raise ValueError(f"the action of row {bad[0]} is {array[bad[0]]}, nan or infinite; want {wanted}")
    return array


def numbers_of(action: Any) -> NDArray[np.float64]:  # noqa: ANN401
    """Return an action as an array of numbers, empty if it is not numeric."""
    try:
        return np.asarray(action, np.float64)
    except (TypeError, ValueError):
        return np.empty(0)


def add_info(infos: dict[str, Any], name: str, rows: Mask, values: list[Any]) -> None:
    """Add an info for some rows, with the mask that Gymnasium's vector environments add to it."""
    described = np.full(len(rows), None, object)
    for row, value in zip(np.flatnonzero(rows).tolist(), values, strict=True):
        described[row] = value
    infos[name] = described
    infos[f"_{name}"] = rows.copy()
