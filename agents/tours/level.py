"""Decisions by tours: a robot chooses one of the stops of the team's tours, that of `tour_frontier` first."""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from lidarium.agents.frontier.reach import Choice
from lidarium.agents.tours.planning import TourOptions, TourRequest, TourSettings, first_options, tour_options
from lidarium.agents.tours.policy import TourFrontier
from lidarium.envs.levels.frontier import OffersLevel, Picks
from lidarium.envs.levels.level import STEPS, Mask, Turn
from lidarium.envs.levels.waypoint import Ways
from lidarium.envs.onboard.belief import Belief
from lidarium.envs.onboard.perception import Perception
from lidarium.envs.onboard.radio.messages import DriveState, Orders, Target
from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.mapping.planning.grid_planning import centres_of

FARTHEST = 1e4
"""Bound of the numbers of a stop."""

STOP_NUMBERS = ("x", "y", "way", "gain", "size", "place", "is_own", "is_kept")
"""The numbers of a stop.

Position relative to the robot and length of the way there [m], unknown area in view [m2], length of the frontier [m],
position in its tour starting at 1, whether that is the robot's own tour, and whether the robot drives there already.
"""


class _Offer(NamedTuple):
    """The stops offered to a robot.

    Attributes
    ----------
    options : TourOptions or None
        The tours, if they were planned just now.
    numbers : list of int
        Numbers of the options, the first for the first action; -1 for an action that means another choice.
    choice : Choice or None
        That other choice; None to stay.
    """

    options: TourOptions | None
    numbers: list[int]
    choice: Choice | None


class _Team:
    """The robots of an episode, as policies see them."""

    def __init__(self, level: "TourLevel", episode: int) -> None:
        self.settings, self._level, self._first = level.settings, level, episode * level.settings.robots
        self._index = {agent: robot for robot, agent in enumerate(self.settings.agents)}
        self.agents, self._episode = list(self._index), episode

    @property
    def time_s(self) -> float:
        """Simulated time [s]."""
        return float(self._level.perception.world.steps[self._episode]) * self.settings.time_step

    def belief(self, agent: str) -> Belief:
        """Return the handle on the belief of an agent."""
        return Belief(self._level.perception, self._first + self._index[agent])

    def drive_state(self, agent: str) -> DriveState:
        """Return the state of an agent's drive to its target."""
        return self._level.driver.state(self._first + self._index[agent])


class TourLevel(OffersLevel):
    """An action is the number of a stop of the team's tours, or a ``Target``, a ``Route`` or None.

    Tours are those of `tour_frontier`, planned again when a robot has no goal any more; a decision lasts for 0.5 s.
    Action 0 is always what `tour_frontier` does: it sets out to the first stop of the robot's tour, goes on to its
    goal, or stays if the tours have no stop for it. Actions 1 to K - 1 set out to other stops, nearest first; they are
    allowed just after a plan. Action K stays, as does one that the mask rules out.

    Observations have ``tours`` float32 (K, 8), see ``STOP_NUMBERS``, zeros after the last, and ``action_mask`` int8
    (K + 1,). If no robot of a team has anything on offer, all end with ``no_frontier`` or ``frontier_unreachable``.
    """

    noun = "stop"

    def __init__(
        self,
        perception: Perception,
        settings: ExplorationSettings,
        shares_map: bool = True,
        decision_period_s: float | None = None,
    ) -> None:
        super().__init__(perception, settings, shares_map, decision_period_s or TourFrontier.decision_period_s)
        self._shares_map, self.tours = shares_map, TourSettings()
        high = np.full((self.tours.most, len(STOP_NUMBERS)), FARTHEST, np.float32)
        low = np.zeros_like(high)
        low[:, :2] = -FARTHEST
        self.boxes["tours"] = spaces.Box(low, high, dtype=np.float32)
        self.offer(self.tours.most)
        self._guides: list[TourFrontier | None] = [None] * perception.world.episodes
        self._offers: list[_Offer] = [_Offer(None, [], None)] * self.rows
        self._tables = np.zeros((self.rows, *high.shape), np.float32)

    def start(self, episode: int) -> None:
        """Begin an episode: there are no tours."""
        super().start(episode)
        guide = self._guides[episode] = TourFrontier(self._shares_map)
        team: Any = _Team(self, episode)
        guide.reset(team)
        rows = self._rows_of(episode)
        self._tables[rows] = 0.0
        self._offers[rows] = [_Offer(None, [], None)] * self.settings.robots

    def _rows_of(self, episode: int) -> slice:
        return slice(episode * self.settings.robots, (episode + 1) * self.settings.robots)

    def _guide(self, episode: int) -> TourFrontier:
        guide = self._guides[episode]
        assert guide is not None
        return guide

    def carry_out(self, decoded: NDArray[np.int64] | Picks, turn: Turn) -> None:  # type: ignore[override]
        """Drive to the chosen stops; end teams of which no robot has one or a target."""
        picks = decoded if isinstance(decoded, Picks) else None
        numbers = decoded.numbers if isinstance(decoded, Picks) else decoded
        has_way = np.zeros(self.rows, np.bool_) if picks is None else picks.has_way
        targets: list[Target | None] = [None] * self.rows
        agents, operating = self.settings.agents, turn.operating
        for episode in np.flatnonzero(turn.modes == STEPS).tolist():
            guide, first = self._guide(episode), episode * self.settings.robots
            acting = [row for row in range(first, first + len(agents)) if turn.acting[row]]
            for row in acting:
                if turn.given[row] and row not in operating.stopping:
                    agent = agents[row - first]
                    guide.take({agent: None if has_way[row] else self._chosen(guide, agent, row, int(numbers[row]))})
                    targets[row] = guide.target(agent)
            idle = [row for row in acting if not self._offers[row].numbers]
            is_sent = any(row in operating.sent for row in acting)
            is_driven = picks is not None and (has_way & picks.ways.orders.is_ordered)[acting].any()
            if len(idle) == len(acting) and not is_sent and not is_driven and turn.given[acting].all():
                for row in idle:
                    if row not in operating.stopping:
                        operating.stopping[row] = guide.reason(agents[row - first])
        orders = Orders.of(targets)
        if picks is not None:
            given = picks.ways.orders
            orders = Orders(
                np.where(has_way, given.is_ordered, orders.is_ordered),
                np.where(has_way[:, None], given.targets, orders.targets),
                np.where(has_way, given.headings, orders.headings),
            )
        super().carry_out(Ways(orders, {} if picks is None else picks.ways.routes), turn)

    def _chosen(self, guide: TourFrontier, agent: str, row: int, number: int) -> Choice | None:
        """Return the choice that an action means."""
        offer = self._offers[row]
        if number >= len(offer.numbers):
            return None
        option = offer.numbers[number]
        return offer.choice if option < 0 or offer.options is None else guide.choice_of(agent, option, offer.options)

    def observe(self, acted: Mask, live: Mask, seen: Mask, out: dict[str, NDArray[Any]], infos: dict[str, Any]) -> None:
        """Plan the tours of all teams of which a robot needs a goal, offer their stops and report drives."""
        robots, agents = self.settings.robots, self.settings.agents
        groups: list[tuple[int, list[str]]] = []
        requests: list[TourRequest] = []
        for episode in np.flatnonzero(seen.reshape(-1, robots).any(axis=1)).tolist():
            guide, rows = self._guide(episode), self._rows_of(episode)
            self._offers[rows] = [_Offer(None, [], None)] * robots
            team = [agent for agent, is_live in zip(agents, live[rows], strict=True) if is_live]
            open_agents = guide.review(team)
            for agent in team:
                if (choice := guide.current(agent)) is not None:
                    self._offers[rows.start + agents.index(agent)] = _Offer(None, [-1], choice)
            for members in guide.groups(team, open_agents) if open_agents else ():
                groups.append((episode, members))
                requests.append(guide.request(members))
        if requests:
            guide = self._guide(groups[0][0])
            threads = self.perception.threads_for(len(requests))
            plans = tour_options(requests, guide.footprint.radius, self.tours, guide.rules, threads)
            for (episode, members), options in zip(groups, plans, strict=True):
                self._offer_stops(episode, members, options)
        for row in np.flatnonzero(seen).tolist():
            self._describe(row)
            mask = out["action_mask"][row]
            mask[:], mask[[0, self._stay]] = 0, 1
            mask[: len(self._offers[row].numbers)] = 1
        out["tours"][seen] = self._tables[seen]
        super().observe(acted, live, seen, out, infos)

    def _offer_stops(self, episode: int, members: Sequence[str], options: TourOptions | None) -> None:
        """Offer the stops of the tours of some robots on one map; the nearest frontiers if there are none."""
        guide, first = self._guide(episode), episode * self.settings.robots
        wanted = [] if options is None else first_options(options)[: len(members)]
        for k, agent in enumerate(members):
            row = first + self.settings.agents.index(agent)
            self._tables[row] = 0.0
            if options is None or all(each is None for each in wanted):
                choice = guide.current(agent) or guide.nearest(agent)
                self._offers[row] = _Offer(None, [] if choice is None else [-1], choice)
                continue
            own = wanted[k]
            others = [int(option) for option in np.flatnonzero(options.is_reached[k]) if option != own]
            numbers = [-1 if own is None else own, *others][: self._stay]
            self._offers[row] = _Offer(options, numbers, None)
            self._tables[row, : len(numbers)] = np.minimum(_numbers_of(options, k, numbers), FARTHEST)

    def _describe(self, row: int) -> None:
        """Write where the stops on offer are from the robot; a goal that it goes on to keeps its other numbers."""
        offer, table = self._offers[row], self._tables[row]
        if not offer.numbers:
            table[:] = 0.0
            return
        belief = Belief(self.perception, row)
        resolution, (x, y) = self.settings.occupancy.resolution, belief.pose[:2]
        if offer.options is None:
            table[1:] = 0.0
            cells = np.array([(0, 0) if offer.choice is None else offer.choice.cell])
        else:
            cells = offer.options.cells[offer.numbers]
        places = np.asarray(centres_of(cells, belief.map_origin, resolution))
        table[: len(places), :2] = places - (x, y)
        if offer.numbers[0] < 0 and offer.choice is None:
            table[0] = 0.0
        elif offer.options is None:
            table[0, 2] = max(float(table[0, 2]), math.hypot(table[0, 0], table[0, 1]))
            table[0, 7] = 1.0


def _numbers_of(options: TourOptions, robot: int, numbers: list[int]) -> NDArray[np.float64]:
    """Return the numbers of the stops on offer to a robot, without their positions."""
    count = len(options.numbers)
    places, owners = np.zeros(count), np.zeros(count, np.int64)
    owner, place = 0, 0
    for number in options.sequence.tolist():
        if number >= count:
            owner, place = owner + 1, 0
            continue
        place += 1
        places[number], owners[number] = place, owner
    sizes = np.diff(options.clusters.starts)[options.numbers] * (options.grid.side / options.grid.factor)
    zeros = np.zeros(count)
    columns = [
        *(zeros, zeros, options.lengths[robot], options.gains, sizes, places),
        *(owners == robot, options.is_kept[robot]),
    ]
    return np.stack(columns, axis=1)[numbers]
