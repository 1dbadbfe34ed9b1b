"""Decisions by frontiers: a robot chooses one of those that it can reach, cheapest path first."""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numba
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from lidarium.envs.levels.frontier_choices import (
    FARTHEST,
    MOST_GAIN,
    Choices,
    Offers,
    Renewal,
    ViewReach,
    ray_directions,
    renew_teams,
)
from lidarium.envs.levels.level import STEPS, Level, Mask, Turn, add_info, check_rows
from lidarium.envs.levels.waypoint import WaypointLevel, Ways, is_way, read_ways
from lidarium.envs.onboard.driving.drives import Drives
from lidarium.envs.onboard.driving.planning import Planning
from lidarium.envs.onboard.driving.team_driver import TeamDriver, footprint_of
from lidarium.envs.onboard.perception import Perception
from lidarium.envs.onboard.radio.messages import Orders, Target
from lidarium.envs.onboard.team_maps import TeamMaps
from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.envs.settings.limits import GAINS
from lidarium.mapping.geometry.bounds import shown
from lidarium.mapping.kernels.compilation import kernel
from lidarium.mapping.kernels.work_queue import Work, new_work, share_of
from lidarium.mapping.planning.frontiers.approach import default_reach
from lidarium.mapping.planning.search.search_state import disc_spans
from lidarium.mapping.planning.search.swept_costs import SweepMemory

REASONS = ("", "unseen", "blocked", "no_progress")
"""Reasons for giving up a chosen frontier, by number; 0 if it is not given up."""


_renew_teams_serial = kernel(renew_teams)


@kernel(parallel=True)
def _renew_teams_parallel(
    planning: Planning,
    maps: TeamMaps,
    drives: Drives,
    view: ViewReach,
    offers: Offers,
    choices: Choices,
    renewal: Renewal,
    work: Work,
) -> None:
    for thread in numba.prange(work.threads):
        _renew_teams_serial(planning, maps, drives, view, offers, choices, renewal, share_of(work, thread))


class FrontierOffers:
    """Offers frontiers to the robots of all episodes, and keeps their choices.

    Parameters
    ----------
    perception : Perception
        The beliefs of the robots.
    settings : ExplorationSettings
        The team of every episode.
    driver : TeamDriver
        Drives the robots; frontiers are searched on the same maps.

    Attributes
    ----------
    offers : Offers
        Frontiers offered to every robot.
    choices : Choices
        Frontiers chosen by every robot.
    """

    def __init__(self, perception: Perception, settings: ExplorationSettings, driver: TeamDriver) -> None:
        self._perception, self._driver, self._robots = perception, driver, settings.robots
        rows, resolution = settings.robots * perception.world.episodes, settings.occupancy.resolution
        reach = default_reach(footprint_of(settings.robot.radius), resolution) / resolution
        offers, self._memory = settings.frontiers, SweepMemory(len(perception.memory.table))
        self._view = ViewReach(
            # A copy that can be written to, as copies of environments have it: one type to kernels.
            disc_spans(reach).copy(),
            reach,
            settings.time_step,
            settings.least_frontier,
            round(offers * settings.frontiers_by_size),
            ray_directions(),
            np.array([round(lidar.range_max / resolution) for lidar in settings.team_lidars], np.int64),
        )
        is_gain_observed = GAINS in settings.observe
        self.offers = Offers(
            np.zeros((rows, offers, 4), np.float32),
            np.zeros((rows, offers + 1), np.int8),
            np.zeros(rows, np.int64),
            np.zeros((rows, offers, 2)),
            np.full((rows, offers), np.nan),
            np.zeros((rows, offers, 2), np.int64),
            np.zeros((rows, offers) if is_gain_observed else (0, 0), np.float32),
        )
        self.choices = Choices(
            np.zeros(rows, np.bool_),
            np.zeros((rows, 2)),
            np.full(rows, np.nan),
            np.zeros((rows, 2), np.int64),
            np.full((rows, 2), -1, np.int64),
            np.zeros((rows, 2)),
            np.zeros(rows),
        )

    def start(self, episode: int = 0) -> None:
        """Begin an episode: nothing is offered or chosen."""
        rows = slice(episode * self._robots, (episode + 1) * self._robots)
        for grid in self._perception.beliefs.log_odds[rows]:
            self._memory.fit(*grid.shape)
        self.offers.counts[rows], self.offers.tables[rows], self.offers.masks[rows] = 0, 0.0, 0
        self.choices.is_chosen[rows], self.choices.tried[rows] = False, -1

    @property
    def observed(self) -> dict[str, NDArray[Any]]:
        """Return the offers as observations, arrays over rows by key."""
        offers = self.offers
        gains = {GAINS: offers.gains} if offers.gains.size else {}
        return {"frontiers": offers.tables, "action_mask": offers.masks, **gains}

    def choose(self, rows: NDArray[np.bool_], numbers: NDArray[np.int64]) -> Orders:
        """Take the choices of robots, those named by ``rows`` (rows,).

        Parameters
        ----------
        rows : (rows,) bool
            Rows that choose.
        numbers : (rows,) int64
            Number of an offer; any that is not offered lets the robot stay.

        Returns
        -------
        Orders
            Targets to drive to; robots that do not choose stay.
        """
        offers, choices = self.offers, self.choices
        is_taken = rows & (numbers >= 0) & (numbers < offers.counts)
        taken = np.flatnonzero(is_taken)
        choices.is_chosen[rows] = is_taken[rows]
        choices.targets[taken] = offers.targets[taken, numbers[taken]]
        choices.headings[taken] = offers.headings[taken, numbers[taken]]
        choices.cells[taken] = offers.cells[taken, numbers[taken]]
        return Orders(is_taken, choices.targets, choices.headings)

    def renew(self, is_live: NDArray[np.bool_], is_offered: NDArray[np.bool_]) -> NDArray[np.int8]:
        """Give up unreachable or unproductive choices and offer again.

        Called after the steps of a decision, and at the start.

        Parameters
        ----------
        is_live, is_offered : (rows,) bool
            Rows with choices to examine, and rows to offer frontiers.

        Returns
        -------
        (rows,) int8
            Why each robot's chosen frontier was given up, by number in ``REASONS``; 0 if it was not.
        """
        reasons = np.zeros(len(is_live), np.int8)
        is_due = is_offered | is_live & self.choices.is_chosen
        rows, episodes = np.flatnonzero(is_due), np.flatnonzero(is_due.reshape(-1, self._robots).any(axis=1))
        if len(episodes):
            threads = self._perception.threads_for(len(episodes))
            renew = _renew_teams_parallel if threads > 1 else _renew_teams_serial
            renew(
                self._driver.planning(rows, with_frontiers=True),
                self._perception.maps,
                self._driver.drives,
                self._view,
                self.offers,
                self.choices,
                Renewal(is_live, is_offered, reasons, self._memory.table),
                new_work(episodes, threads),
            )
        return reasons

    def target(self, row: int) -> Target:
        """Return the target that a robot chose last."""
        (x, y), heading = self.choices.targets[row], float(self.choices.headings[row])
        return Target(float(x), float(y), None if math.isnan(heading) else heading)

    def why_without_work(self, row: int) -> str:
        """Return why a robot that is offered nothing has nothing to do."""
        navigation = self._perception.planning_map(row, self._driver.shares_map)
        return "frontier_unreachable" if navigation.frontiers.flags.any() else "no_frontier"


class Picks(NamedTuple):
    """Numbers that some robots choose, and targets of the others.

    Attributes
    ----------
    numbers : (rows,) int64
        Numbers of what is on offer; that of staying for robots with targets.
    has_way : (rows,) bool
        Robots with targets, routes or None.
    ways : Ways
        Their targets and routes.
    """

    numbers: NDArray[np.int64]
    has_way: Mask
    ways: Ways


class OffersLevel(WaypointLevel):
    """An action is the number of one of some places on offer, the last one to stay; or a ``Target``, ``Route`` or None.

    Attributes
    ----------
    noun : str
        The kind of place, for messages.
    """

    carries = frozenset({"waypoint"})
    noun = "frontier"

    def offer(self, count: int) -> None:
        """Let actions be numbers below ``count``, or ``count`` to stay."""
        self._stay = count
        self.action_space = spaces.Discrete(count + 1)
        self.boxes["action_mask"] = spaces.Box(0, 1, (count + 1,), np.int8)

    def read(  # type: ignore[override]
        self, actions: Mapping[int, Any], names: list[str]
    ) -> NDArray[np.int64] | Picks:
        """Return the numbers that are chosen (rows,), and targets."""
        numbers = np.full(self.rows, self._stay)
        ways = {row: action for row, action in actions.items() if is_way(action)}
        chosen = {row: action for row, action in actions.items() if row not in ways}
        if not self.reads_rows_as(OffersLevel):
            numbers, chosen = Level.read(self, chosen, names), {}
        for row, action in chosen.items():
            number = _whole_number(action, self._stay)
            if number is None:
                raise ValueError(
                    f"action of {names[row % len(names)]} is {shown(action)}; want a {self.noun} from 0 to "
                    f"{self._stay - 1}, or {self._stay} to stay"
                )
            numbers[row] = number
        if not ways:
            return numbers
        has_way = np.zeros(self.rows, np.bool_)
        has_way[list(ways)] = True
        return Picks(numbers, has_way, read_ways(ways, self.rows))

    def read_rows(self, actions: Any, live: Mask) -> NDArray[np.int64]:  # type: ignore[override]  # noqa: ANN401
        """Return the numbers that are chosen (rows,)."""
        wanted = f"a whole number from 0 to {self._stay}"
        numbers = check_rows(actions, (self.rows,), live, wanted)
        is_bad = live & ((numbers < 0) | (numbers > self._stay) | (numbers != np.floor(numbers)))
        if is_bad.any():
            bad = int(np.flatnonzero(is_bad)[0])
            raise ValueError(f"the action of row {bad} is {numbers[bad]}; want {wanted}, {self._stay} to stay")
        return np.where(live, numbers, self._stay).astype(np.int64)


class FrontierLevel(OffersLevel):
    """An action is the number of a frontier, or a ``Target``, a ``Route`` or None as at the level of waypoints.

    Observations have ``frontiers`` float32 (F, 4): position along the axes of the map frame from the believed
    position of the robot [m], cost of the path [m] and size [m] of each frontier on offer, cheapest path first, zeros
    after the last; and ``action_mask`` int8 (F + 1,). F is ``settings.frontiers``. Action k < F drives to frontier k,
    action F stays and gives way; an action that the mask rules out stays as well.

    A frontier to which a robot has driven and turned, and which is still there, is not offered again; the info
    ``given_up`` names it with the reason. Robots without a frontier in reach stay idle; if no robot has one, all end
    with ``no_frontier`` or ``frontier_unreachable``.
    """

    def __init__(
        self,
        perception: Perception,
        settings: ExplorationSettings,
        shares_map: bool = True,
        decision_period_s: float | None = None,
    ) -> None:
        super().__init__(perception, settings, shares_map)
        del decision_period_s
        self.offers = FrontierOffers(perception, settings, self.driver)
        count = settings.frontiers
        high = np.full((count, 4), FARTHEST, np.float32)
        low = np.tile(np.array([-FARTHEST, -FARTHEST, 0.0, 0.0], np.float32), (count, 1))
        if GAINS in settings.observe:
            self.boxes[GAINS] = spaces.Box(0.0, MOST_GAIN, (count,), np.float32)
        self.boxes["frontiers"] = spaces.Box(low, high, dtype=np.float32)
        self.offer(count)

    def start(self, episode: int) -> None:
        """Begin an episode: nothing is offered."""
        super().start(episode)
        self.offers.start(episode)

    def carry_out(self, decoded: NDArray[np.int64] | Picks, turn: Turn) -> None:  # type: ignore[override]
        """Drive to the chosen frontiers; end teams of which no robot is offered any or has a target.

        A robot that an order sends elsewhere has no choice any more; a paused one keeps its own.
        """
        operating, robots = turn.operating, self.settings.robots
        picks = decoded if isinstance(decoded, Picks) else None
        chosen = decoded.numbers if isinstance(decoded, Picks) else decoded
        is_sent = np.zeros(self.rows, np.bool_)
        is_sent[list(operating.sent)] = True
        is_stopping = np.zeros(self.rows, np.bool_)
        is_stopping[list(operating.stopping)] = True
        numbers = np.where(is_sent, self._stay, chosen)
        choosing = turn.given & ~is_stopping & ~operating.held | is_sent
        orders = self.offers.choose(choosing, numbers)
        is_free = (turn.given | ~turn.acting).reshape(-1, robots).all(axis=1)
        is_free &= ~is_sent.reshape(-1, robots).any(axis=1)
        is_busy = self.offers.offers.counts > 0
        if picks is not None:
            is_driven = picks.has_way & turn.given
            is_busy |= is_driven & picks.ways.orders.is_ordered
            given = picks.ways.orders
            orders = Orders(
                np.where(is_driven, given.is_ordered, orders.is_ordered),
                np.where(is_driven[:, None], given.targets, orders.targets),
                np.where(is_driven, given.headings, orders.headings),
            )
        has_work = (turn.acting & is_busy).reshape(-1, robots).any(axis=1)
        is_idle = np.repeat((turn.modes == STEPS) & is_free & ~has_work, robots)
        for row in np.flatnonzero(is_idle & turn.acting & ~is_stopping).tolist():
            operating.stopping[row] = self.offers.why_without_work(row)
        super().carry_out(Ways(orders, {} if picks is None else picks.ways.routes), turn)

    def observe(self, acted: Mask, live: Mask, seen: Mask, out: dict[str, NDArray[Any]], infos: dict[str, Any]) -> None:
        """Give up unreachable or unproductive choices, offer again, and report both."""
        reasons = self.offers.renew(live, seen)
        where = slice(None) if seen.all() else seen
        for name, array in self.offers.observed.items():
            out[name][where] = array[where]
        super().observe(acted, live, seen, out, infos)
        rows = np.flatnonzero(reasons).tolist()
        if rows:
            given_up = [(self.offers.target(row), REASONS[reasons[row]]) for row in rows]
            add_info(infos, "given_up", reasons != 0, given_up)


def _whole_number(action: Any, maximum: int) -> int | None:  # noqa: ANN401
    """Return an action as a number from 0 to ``maximum``, None if it is not one; arrays of one number count."""
    try:
        array = np.asarray(action)
    except ValueError:  # rows of different lengths
        return None
    if array.shape not in ((), (1,)) or array.dtype.kind not in "iuf":
        return None
    number = float(array.item())
    return int(number) if number.is_integer() and 0 <= number <= maximum else None
