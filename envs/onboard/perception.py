"""What the robots' onboard software knows: poses, maps and received data.

This includes what reached each of the others.

With known starts and the ideal radio all robots of a team share one map, the sum of their log-odds. A robot
that does not know its start can be told what others know, laid over its own map. All maps come with what
planning needs (clearance and frontiers), brought up to date only where the map has changed.
"""

import os
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.onboard.meters import Meters
from lidarium.envs.onboard.navigation import (
    CLEARANCE_LIMIT,
    FLAGS,
    LOG_ODDS,
    RECORD,
    NavigationMap,
    extend_window,
    refresh_map,
)
from lidarium.envs.onboard.team_maps import TeamMaps, refresh_team, sum_maps, sum_team
from lidarium.envs.onboard.teammate import Teammate
from lidarium.envs.radio.exchange import NEVER, Exchange
from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.envs.simulation.kernels.arrays import ENDED
from lidarium.envs.simulation.simulation import Simulation
from lidarium.mapping.kernels.compilation import use_threads
from lidarium.mapping.localization.dead_reckoning.localizer import Localizer
from lidarium.mapping.merging.fusion import FusedMap, overlay
from lidarium.mapping.planning.clearance import limit_of, stamp_of
from lidarium.mapping.planning.footprint_masks import MARGIN_M, passed
from lidarium.mapping.planning.frontier_kernels import IGNORED
from lidarium.mapping.planning.search.path_search import SearchMemory


class Perception:
    """The onboard software of the teams of all episodes.

    It keeps maps for navigation up to date, on demand.

    Parameters
    ----------
    simulation : Simulation
        Whose maps and believed poses they are; row = episode * robots + robot.
    settings : ExplorationSettings
        The team of every episode.
    offsets : (rows, 2) float64
        Origin of each robot's map frame in the frame of its believed pose [m]; the environment's own array.

    Attributes
    ----------
    memory : SearchMemory
        For the searches of kernels, a piece for each thread.
    knows_mates : bool
        Whether all teammates' poses are known at once.
    hears : bool
        Whether a robot's map of the team is what reached it by radio.
    exchanges : list of Exchange
        The radio traffic of each episode; none where the radio is ideal.
    localizers : list of Localizer or None
        What tells each robot's pose, by row; None where kernels do.
    meters : Meters or None
        Odometers and battery gauges of the robots of a lone episode; None in batches, which have none.
    """

    def __init__(
        self, simulation: Simulation, settings: ExplorationSettings, offsets: NDArray[np.float64]
    ) -> None:
        self.simulation, self.settings, self.offsets = simulation, settings, offsets
        self.world, self.beliefs = simulation.world, simulation.beliefs
        self._robots, self._episodes = settings.robots, simulation.episodes
        rows = self._robots * self._episodes
        self._own: list[NavigationMap | None] = [None] * rows
        self._shared: list[NavigationMap | None] = [None] * self._episodes
        self._goals: list[tuple[float, float] | None] = [None] * self._episodes
        self._own_records = np.zeros((rows, RECORD), np.int64)
        self._shared_records = np.zeros((self._episodes, RECORD), np.int64)
        self._known = np.zeros((rows, 4), np.int64)
        self._fresh_at = np.full(self._episodes, -2, np.int64)
        self._threads = min(settings.threads, int(os.cpu_count() or 1))
        self.memory = SearchMemory(self._threads)
        is_team = settings.known_starts and settings.robots > 1
        self._shares, self.hears = (
            is_team and settings.radio.is_ideal,
            is_team and not settings.radio.is_ideal,
        )
        self.knows_teammates = settings.known_starts and settings.radio.is_ideal
        self.exchanges = (
            []
            if settings.radio.is_ideal
            else [Exchange(simulation, settings, episode) for episode in range(self._episodes)]
        )
        self.localizers: list[Localizer | None] = [None] * rows
        self.meters: Meters | None = None
        self._heard: list[NavigationMap | None] = [None] * rows
        self._heard_records = np.zeros((rows, RECORD), np.int64)
        self._told: list[NDArray[np.int8] | None] = [None] * rows
        self._trails: list[list[NDArray[np.float64]]] = [[] for _ in range(rows)]
        # Whether robots plan on sums of their own map and of what came from others.
        self._adds_up = self.hears

    def start(self, goal: tuple[float, float] | None = None, episode: int = 0) -> None:
        """Begin an episode."""
        first, last = episode * self._robots, (episode + 1) * self._robots
        for navigation in (*self._own[first:last], *self._heard[first:last], self._shared[episode]):
            if navigation is not None:
                # Whoever still holds a map of the last episode may go on reading it.
                navigation.keep_record_in(np.zeros(RECORD, np.int64))
        self._own[first:last], self._shared[episode] = [None] * self._robots, None
        self._heard[first:last], self._heard_records[first:last] = [None] * self._robots, 0
        self._told[first:last] = [None] * self._robots
        self._trails[first:last] = [[] for _ in range(self._robots)]
        self._adds_up = self.hears or any(told is not None for told in self._told)
        self._own_records[first:last], self._shared_records[episode] = 0, 0
        self._known[first:last] = [
            (rows, 0, columns, 0) for rows, columns in self.beliefs.belief_rows[first:last, 1:3]
        ]
        self._goals[episode], self._fresh_at[episode] = goal, -2

    @property
    def maps(self) -> TeamMaps:
        """The maps as kernels see them."""
        if self._adds_up:
            # What kernels bring up to date by themselves does not include what came from others.
            for episode in range(self._episodes):
                self._refresh(episode)
        return self._maps

    @property
    def _maps(self) -> TeamMaps:
        world, resolution = self.world, self.settings.occupancy.resolution
        limit = limit_of(CLEARANCE_LIMIT, resolution)
        return TeamMaps(
            self._robots,
            self._own_records,
            self._shared_records,
            self.beliefs.belief_rows,
            self.beliefs.windows,
            self._known,
            world.steps,
            self._fresh_at,
            limit,
            stamp_of(limit),
        )

    def threads_for(self, episodes: int) -> int:
        """Return the number of threads for kernels over so many episodes.

        Parallel kernels are set to run on as many.
        """
        threads = min(self._threads, episodes)
        if threads > 1:
            use_threads(self._threads)
        return threads

    def episode_of(self, row: int) -> int:
        """Return the episode of a row."""
        return row // self._robots

    def own_map(self, row: int) -> NavigationMap:
        """Return a robot's own map, up to date."""
        self._refresh(self.episode_of(row))
        navigation = self._own[row]
        if navigation is None:
            navigation = NavigationMap(self.beliefs.log_odds[row], self.settings.occupancy.resolution)
            navigation.keep_record_in(self._own_records[row])
            maps = self._maps
            refresh_map(navigation.record, maps.limit, maps.stamp, self._known[row])
            self._own[row] = navigation
        return navigation

    def known_window(self, row: int) -> tuple[int, int, int, int]:
        """Return the rows and columns that hold all that a robot's own map knows.

        They are the first and the last, the last exclusive.
        """
        self.own_map(row)
        low_row, high_row, low_column, high_column = (int(value) for value in self._known[row])
        rows, columns = self.beliefs.log_odds[row].shape
        low_row, low_column = max(low_row, 0), max(low_column, 0)
        return (
            low_row,
            max(min(high_row, rows), low_row),
            low_column,
            max(min(high_column, columns), low_column),
        )

    def shared_map(self, row: int = 0) -> NavigationMap | None:
        """Return the team's map as it reached a robot, up to date.

        A lone robot's is its own, with unknown starts what it was told.
        """
        if not self.settings.known_starts:
            return None if self._told[row] is None else self._heard_map(row)
        if self.hears:
            return self._heard_map(row)
        if not self._shares:
            return self.own_map(row)
        episode = self.episode_of(row)
        self._refresh(episode)
        navigation = self._shared[episode]
        if navigation is None:
            first = episode * self._robots
            log_odds = np.zeros(self.beliefs.log_odds[first].shape, np.int8)
            navigation = NavigationMap(log_odds, self.settings.occupancy.resolution)
            navigation.keep_record_in(self._shared_records[episode])
            for row in range(first, first + self._robots):
                sum_team(self._maps, episode, self._known[row])
            self._shared[episode] = navigation
        return navigation

    def tell(self, row: int, others: FusedMap | None) -> None:
        """Let a robot that does not know its start know what others know.

        It plans and explores on that as on its own map.

        Parameters
        ----------
        row : int
            Which robot.
        others : FusedMap or None
            What the others know, in the robot's map frame; it takes the place of what was told before. None
            takes that back.

        Raises
        ------
        ValueError
            Where the starts are known, so that the team's map is there anyway, or the sides of the cells
            differ.
        """
        resolution = self.settings.occupancy.resolution
        if self.settings.known_starts:
            raise ValueError(
                "robots that know their starts have the team's map; want robots with unknown starts to be "
                "told of others"
            )
        if others is not None and others.resolution != resolution:
            raise ValueError(
                f"the map that is told has cells of {others.resolution} m; want {resolution} m, as the "
                "robots' own maps"
            )
        if others is None and self._told[row] is None:
            return
        told = np.zeros(self.beliefs.log_odds[row].shape, np.int8)
        if others is not None:
            overlay(told, others, self.origin_in_frame(row))
        before = self._told[row]
        is_other = told != 0 if before is None else told != before
        self._told[row], self._adds_up = told, True
        rows, columns = np.flatnonzero(is_other.any(axis=1)), np.flatnonzero(is_other.any(axis=0))
        if self._heard[row] is not None and len(rows):
            self._sum_heard(row, np.array([rows[0], rows[-1] + 1, columns[0], columns[-1] + 1]))

    def forget_walls(self, row: int, trail: NDArray[np.float64]) -> None:
        """Let a robot forget the walls along a trail.

        They may be images of the robot that drove there. The robot senses the place for itself.

        Parameters
        ----------
        row : int
            Which robot.
        trail : (N, 2) float64
            Where the other one was, in the map frame of this [m]; what may show it where it stands at the end
            is kept.

        Raises
        ------
        ValueError
            Where the trail is not that of a robot: of another shape, without a place, or not finite.
        """
        if trail.ndim != 2 or trail.shape[1] != 2 or not len(trail) or not np.isfinite(trail).all():
            raise ValueError(
                f"the trail has shape {trail.shape} and may not be finite; want places (N, 2) in metres, at "
                "least one"
            )
        self._trails[row].append(trail)
        self._forget(row, trail)

    def forget_again(self, row: int) -> None:
        """Forget the walls again along all trails that a robot has received.

        This is done after its map was rendered anew.
        """
        for trail in self._trails[row]:
            self._forget(row, trail)

    def _forget(self, row: int, trail: NDArray[np.float64]) -> None:
        resolution, radius = self.settings.occupancy.resolution, float(self.world.bodies[:, 0].max())
        origin, whole = np.array(self.origin_in_frame(row)), self.beliefs.log_odds[row]
        reach = radius + MARGIN_M + resolution
        low = np.clip(
            np.floor((trail.min(axis=0) - reach - origin) / resolution).astype(np.int64), 0, whole.shape[::-1]
        )
        high = np.clip(
            np.ceil((trail.max(axis=0) + reach - origin) / resolution).astype(np.int64),
            low,
            whole.shape[::-1],
        )
        (left, bottom), (right, top) = low.tolist(), high.tolist()
        part = whole[bottom:top, left:right]
        x, y = (origin + low * resolution).tolist()
        self.beliefs.forget(
            row, passed(part.shape, (x, y), trail, radius, resolution) & (part > 0), (bottom, left)
        )
        self._fresh_at[self.episode_of(row)] = -2

    def _heard_map(self, row: int) -> NavigationMap:
        """Return the sum of a robot's own map and those received, up to date."""
        self._refresh(self.episode_of(row))
        navigation = self._heard[row]
        if navigation is None:
            log_odds = np.zeros(self.beliefs.log_odds[row].shape, np.int8)
            navigation = NavigationMap(log_odds, self.settings.occupancy.resolution)
            navigation.keep_record_in(self._heard_records[row])
            self._heard[row] = navigation
            _, rows, columns = self.beliefs.belief_rows[row, :3]
            self._sum_heard(row, np.array([0, rows, 0, columns]))
            own = self._own[row]
            if not self.hears and own is not None and own.record[FLAGS] != 0:
                # What the robot gave up on its own map it does not try again.
                navigation.frontiers.ignore(np.argwhere(own.frontiers.flags == IGNORED))
        return navigation

    def _sum_heard(self, row: int, window: NDArray[np.int64]) -> None:
        """Bring the sum of what reached a robot up to date in a window (4,)."""
        episode, first = self.episode_of(row), self.episode_of(row) * self._robots
        told = self._told[row]
        if self.hears:
            copies = self.exchanges[episode].copies[row - first]
            held = [
                copy.ctypes.data
                for teammate, copy in enumerate(copies)
                if first + teammate != row and copy.size
            ]
        else:
            held = [] if told is None else [told.ctypes.data]
        beliefs = np.array(
            [
                (address, *self.beliefs.log_odds[row].shape)
                for address in (self.beliefs.belief_rows[row, 0], *held)
            ],
            np.int64,
        )
        sum_maps(self._heard_records[row], beliefs, self._maps.limit, self._maps.stamp, window)

    def planning_map(self, row: int, shares_map: bool) -> NavigationMap:
        """Return the map that a robot plans on, up to date.

        It is the team's where that reaches the robot, else the robot's own.
        """
        if shares_map and self._adds_up:
            # Also that of a robot to which nothing came: kernels look the maps of all up in one table.
            return self._heard_map(row)
        shared = self.shared_map(row) if shares_map else None
        return self.own_map(row) if shared is None else shared

    def provide_records(
        self, rows: NDArray[np.int64], shares_map: bool, *, with_frontiers: bool = False
    ) -> tuple[NDArray[np.int64], int]:
        """Make the maps that robots plan on where there are none yet, for kernels.

        Returns
        -------
        records : (maps, 10) int64
            A table of records; kernels bring them up to date by ``refresh_team``.
        sharing : int
            How many rows share one record: that of a row is number ``row // sharing``.
        """
        records, sharing = self._own_records, 1
        if shares_map and self._shares:
            records, sharing = self._shared_records, self._robots
        elif shares_map and self._adds_up:
            records = self._heard_records
        places = np.unique(rows // sharing)
        for place in places[records[places, FLAGS if with_frontiers else LOG_ODDS] == 0]:
            navigation = self.planning_map(int(place) * sharing, shares_map)
            if with_frontiers:
                _ = navigation.frontiers
        return records, sharing

    def _refresh(self, episode: int) -> None:
        """Take in what the maps of a team have changed since the last look."""
        if self._fresh_at[episode] == self.world.steps[episode]:
            return
        if not self._adds_up:
            refresh_team(self._maps, episode)
            return
        first = episode * self._robots
        windows = self.beliefs.windows[first : first + self._robots].copy()
        refresh_team(self._maps, episode)
        for robot, window in enumerate(windows):
            if self.hears:
                extend_window(window, self.exchanges[episode].take_window(robot))
            if self._heard[first + robot] is not None and window[0] < window[1] and window[2] < window[3]:
                self._sum_heard(first + robot, window)

    def offset(self, row: int) -> NDArray[np.float64]:
        """Return the origin of a robot's map frame [m], shape (2,).

        It is in the frame of the robot's believed pose.
        """
        return np.asarray(self.offsets[row])

    def pose_in_frame(self, of: int, to: int) -> NDArray[np.float64]:
        """Return the believed pose of a robot in a map frame, shape (3,).

        The frame is another robot's or its own.
        """
        x, y, theta = self.beliefs.believed[of]
        return np.array([x - self.offsets[to, 0], y - self.offsets[to, 1], theta])

    def origin_in_frame(self, row: int) -> tuple[float, float]:
        """Return the lower left corner of a robot's map in its map frame [m]."""
        x, y = self.beliefs.origins[row] - self.offsets[row]
        return float(x), float(y)

    def spread(self, row: int) -> NDArray[np.float64]:
        """Return the standard deviation of a robot's pose [m, m, rad], shape (3,).

        The robot's localizer reports it.
        """
        localizer = self.localizers[row]
        return np.zeros(3) if localizer is None else np.sqrt(np.maximum(np.diag(localizer.covariance), 0.0))

    def pose_known_to(self, row: int, other: int) -> NDArray[np.float64]:
        """Return the pose of a teammate as a robot knows it, shape (3,).

        It is in the frame of believed poses.
        """
        if self.knows_teammates:
            return np.asarray(self.beliefs.believed[other])
        return np.asarray(self.beliefs.heard[row].reshape(-1, 3)[other % self._robots])

    def teammates(self, row: int) -> dict[str, Teammate]:
        """Return what a robot knows of its teammates.

        With known starts and the ideal radio these are their current poses, else the last reported
        ones.
        """
        if not self.settings.known_starts:
            return {}
        first = self.episode_of(row) * self._robots
        if self.hears:
            return self._heard_teammates(row, first)
        return {
            agent: Teammate(
                self.pose_in_frame(other, row),
                0.0,
                self.settings.robot.radius,
                bool(self.world.flags[other] & ENDED),
            )
            for other, agent in enumerate(self.settings.agents, first)
            if other != row
        }

    def _heard_teammates(self, row: int, first: int) -> dict[str, Teammate]:
        """Return what a robot heard of the others."""
        exchange, robot = self.exchanges[self.episode_of(row)], row - first
        step, radius = int(self.world.steps[self.episode_of(row)]), self.settings.robot.radius
        known = {}
        for teammate, agent in enumerate(self.settings.agents):
            if teammate != robot and exchange.heard_at[robot, teammate] != NEVER:
                x, y, theta = exchange.heard[robot, teammate]
                pose = np.array([x - self.offsets[row, 0], y - self.offsets[row, 1], theta])
                age_s = float(step - exchange.heard_at[robot, teammate]) * self.settings.time_step
                known[agent] = Teammate(pose, age_s, radius, bool(exchange.heard_ended[robot, teammate]))
        return known

    def goal_of(self, row: int) -> NDArray[np.float64] | None:
        """Return the goal in a robot's map frame.

        None without a goal, and where the robot does not know its start.
        """
        goal = self._goals[self.episode_of(row)]
        if goal is None or not self.settings.known_starts:
            return None
        return np.asarray(goal - self.offsets[row])

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        kinds = (
            (self._own, self._own_records),
            (self._shared, self._shared_records),
            (self._heard, self._heard_records),
        )
        for maps, records in kinds:
            for navigation, record in zip(maps, records, strict=True):
                if navigation is not None:
                    navigation.keep_record_in(record)


def __getattr__(name: str) -> Any:  # noqa: ANN401
    """Return a name that has moved; it warns."""
    from lidarium.moved import moved_name

    return moved_name(__name__, name)
