"""The beliefs of the robots' onboard software: poses, maps and received data.

This includes data received from the other robots.

With known starts and the ideal radio all robots of a team share one map, the sum of their log-odds. A robot
that does not know its start can be sent the map of others, overlaid on its own map. All maps come with the data that
planning needs (clearance and frontiers), brought up to date only if the map has changed.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.onboard.forgotten_trails import STALE, ForgottenTrails
from lidarium.envs.onboard.known_poses import KnownPoses
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
from lidarium.envs.onboard.radio.exchange import Exchange
from lidarium.envs.onboard.received_maps import ReceivedMaps
from lidarium.envs.onboard.sparse_maps import SparseMaps
from lidarium.envs.onboard.team_maps import TeamMaps, refresh_team, sum_team
from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.envs.simulation.simulation import Simulation
from lidarium.mapping.kernels.compilation import available_threads, use_threads
from lidarium.mapping.planning.clearance import limit_of, stamp_of
from lidarium.mapping.planning.search.path_search import SearchMemory


class Perception:
    """The onboard software of the teams of all episodes.

    It keeps maps for navigation up to date, on demand.

    Parameters
    ----------
    simulation : Simulation
        The simulation with the maps and believed poses; row = episode * robots + robot.
    settings : ExplorationSettings
        The team of every episode.
    offsets : (rows, 2) float64
        Origin of each robot's map frame in the frame of its believed pose [m]; the environment's own array.

    Attributes
    ----------
    memory : SearchMemory
        Scratch of the searches in kernels, one for each thread.
    exchanges : list of Exchange
        The radio traffic of each episode; none if the radio is ideal.
    poses : KnownPoses
        Poses of the robots and their teammates as known to the robots.
    received : ReceivedMaps
        The robots' maps combined with data received from others.
    trails : ForgottenTrails
        The trails of others along which robots forget the walls of their maps.
    sparse_maps : SparseMaps
        The sparse maps that they make by their depth cameras, if these were asked for.
    meters : Meters or None
        Odometers and battery gauges of the robots of a lone episode; None in batches.
    predicts : bool
        Whether robots predict their maps by the network of the package; if so, frames, the live view and replays show
        what it predicts. It may be set, so that they do in any case.
    """

    def __init__(self, simulation: Simulation, settings: ExplorationSettings, offsets: NDArray[np.float64]) -> None:
        self.simulation, self.settings, self.offsets = simulation, settings, offsets
        self.world, self.beliefs = simulation.world, simulation.beliefs
        self._robots, self._episodes = settings.robots, simulation.episodes
        rows = self._robots * self._episodes
        self._own: list[NavigationMap | None] = [None] * rows
        self._shared: list[NavigationMap | None] = [None] * self._episodes
        self._own_records = np.zeros((rows, RECORD), np.int64)
        self._shared_records = np.zeros((self._episodes, RECORD), np.int64)
        self._known = np.zeros((rows, 4), np.int64)
        self._fresh_at = np.full(self._episodes, STALE, np.int64)
        self._threads = min(settings.threads, available_threads())
        self.memory = SearchMemory(self._threads)
        self._shares = settings.known_starts and settings.robots > 1 and settings.radio.is_ideal
        self.exchanges = (
            []
            if settings.radio.is_ideal
            else [Exchange(simulation, settings, episode) for episode in range(self._episodes)]
        )
        self.poses = KnownPoses(simulation, settings, offsets, self.exchanges)
        self.received = ReceivedMaps(simulation, settings, self.poses, self.exchanges)
        self.trails = ForgottenTrails(simulation, settings, self.poses, self._fresh_at)
        self.sparse_maps = SparseMaps(simulation, settings, self.poses, self.exchanges)
        self.meters: Meters | None = None
        self.predicts = "predicted_map" in settings.observe

    @property
    def hears(self) -> bool:
        """Whether a robot's team map holds only data received by radio."""
        return self.received.hears

    def start(self, goal: tuple[float, float] | None = None, episode: int = 0) -> None:
        """Begin an episode."""
        first, last = episode * self._robots, (episode + 1) * self._robots
        for navigation in (*self._own[first:last], self._shared[episode]):
            if navigation is not None:
                # A caller that still holds a map of the last episode may continue to read it.
                navigation.keep_record_in(np.zeros(RECORD, np.int64))
        self._own[first:last], self._shared[episode] = [None] * self._robots, None
        self._own_records[first:last], self._shared_records[episode] = 0, 0
        self._known[first:last] = [(rows, 0, columns, 0) for rows, columns in self.beliefs.belief_rows[first:last, 1:3]]
        self.received.start(range(first, last))
        self.trails.start(range(first, last))
        self.sparse_maps.start(range(first, last))
        self.poses.goals[episode], self._fresh_at[episode] = goal, STALE

    @property
    def maps(self) -> TeamMaps:
        """The maps as kernels see them."""
        if self.received.adds_up:
            # Kernels do not include the maps of others when they bring maps up to date.
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
        """Return the number of threads for kernels over that many episodes.

        Parallel kernels are set to run on as many.
        """
        return min(use_threads(self._threads), episodes) if episodes > 1 else 1

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

        A lone robot's is its own; with unknown starts it is the map that was sent to it.
        """
        if not self.settings.known_starts:
            return self._heard_map(row) if self.received.has_merged_map(row) else None
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

    def _heard_map(self, row: int) -> NavigationMap:
        """Return the sum of a robot's own map and those received, up to date."""
        self._refresh(self.episode_of(row))
        return self.received.sum_of(row, self._own[row])

    def planning_map(self, row: int, shares_map: bool) -> NavigationMap:
        """Return the map that a robot plans on, up to date.

        It is the team's map if it reaches the robot, otherwise the robot's own.
        """
        if shares_map and self.received.adds_up:
            # Also that of a robot to which nothing came: kernels look the maps of all up in one table.
            return self._heard_map(row)
        shared = self.shared_map(row) if shares_map else None
        return self.own_map(row) if shared is None else shared

    def provide_records(
        self, rows: NDArray[np.int64], shares_map: bool, *, with_frontiers: bool = False
    ) -> tuple[NDArray[np.int64], int]:
        """Make the maps that robots plan on if they do not exist yet, for kernels.

        Returns
        -------
        records : (maps, 10) int64
            A table of records; kernels bring them up to date by ``refresh_team``.
        """
        records, sharing = self._own_records, 1
        if shares_map and self._shares:
            records, sharing = self._shared_records, self._robots
        elif shares_map and self.received.adds_up:
            records = self.received.records
        is_missing = records[:, FLAGS if with_frontiers else LOG_ODDS] == 0
        if not is_missing.any():  # as in most decisions
            return records, sharing
        places = np.unique(rows // sharing)
        for place in places[is_missing[places]]:
            navigation = self.planning_map(int(place) * sharing, shares_map)
            if with_frontiers:
                _ = navigation.frontiers
        return records, sharing

    def _refresh(self, episode: int) -> None:
        """Apply the changes of a team's maps since the last step."""
        if self._fresh_at[episode] == self.world.steps[episode]:
            return
        if not self.received.adds_up:
            refresh_team(self._maps, episode)
            return
        first = episode * self._robots
        windows = self.beliefs.windows[first : first + self._robots].copy()
        refresh_team(self._maps, episode)
        for robot, window in enumerate(windows):
            if self.hears:
                extend_window(window, self.exchanges[episode].take_window(robot))
            if self.received.has_sum(first + robot) and window[0] < window[1] and window[2] < window[3]:
                self.received.sum_window(first + robot, window)

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        kinds = ((self._own, self._own_records), (self._shared, self._shared_records))
        for maps, records in kinds:
            for navigation, record in zip(maps, records, strict=True):
                if navigation is not None:
                    navigation.keep_record_in(record)
