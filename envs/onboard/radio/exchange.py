"""Messages that robots of a team exchange over a radio that is not ideal.

The module also keeps track of the data that each robot has received.

In every step each robot sends its pose. Once a period it sends, over each link, the parts that the receiver lacks of
all maps that it holds: its own, and copies received from others. Maps thus spread through robots that meet later. A
message carries blocks of 64 cells, and what has changed in the robot's sparse map if it makes one.

If robots report, a station listens at the start position of the first robot. Each map is sent with the status that
its robot reported at that time. The station receives both over the same links, from the robots themselves or from
robots that hold copies.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.floors.drawing import draw_segments
from lidarium.envs.floors.raster import Raster
from lidarium.envs.onboard.radio.messages import Status
from lidarium.envs.onboard.sparse_shares import SparseShare, bytes_to_send
from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.envs.simulation.backend import World
from lidarium.envs.simulation.disturbances.faults import DEAD_RADIO, has_fault
from lidarium.envs.simulation.disturbances.radio import RADIO_STREAM, asks_for_walls, links, links_to
from lidarium.envs.simulation.kernels.arrays import ENDED
from lidarium.envs.simulation.people.crowd import crowd_of
from lidarium.envs.simulation.simulation import Simulation
from lidarium.mapping.kernels.compilation import Array, kernel

STATION_STREAM = 1
"""Separates the draws for the station's links from those of the robots.

The robots' draws are the same with and without the station.
"""


class RadioLinks:
    """The links of the robots of one episode.

    Parameters
    ----------
    world : World
        The world with the robots.
    settings : ExplorationSettings
        The team and its radio.
    episode : int
        Which episode of the world.

    Attributes
    ----------
    links : (robots, robots) bool
        Links that worked at the last check: sender, receiver.
    station_links : (robots,) bool
        Robots with a link to and from the station at the last check.
    """

    def __init__(self, world: World, settings: ExplorationSettings, episode: int) -> None:
        self._world, self._settings, self._episode = world, settings.radio, episode
        self._rows = range(episode * settings.robots, (episode + 1) * settings.robots)
        self._is_shadowed = settings.radio.shadowing > 0.0
        self.start(0)

    def start(self, seed: int) -> None:
        """Begin an episode without links; chance comes from ``seed``."""
        robots = len(self._rows)
        self._generator = np.random.default_rng([seed, RADIO_STREAM])
        self._station_generator = np.random.default_rng([seed, RADIO_STREAM, STATION_STREAM])
        self._chance, self._station_chance = np.zeros((robots, robots)), np.zeros(robots)
        self.links, self.station_links = np.zeros((robots, robots), np.bool_), np.zeros(robots, np.bool_)

    def find(self, step: int, *, draws: bool) -> None:
        """Find out which robots reach each other.

        The shadowing is drawn again if ``draws``.
        """
        if draws and self._is_shadowed:
            self._chance = self._generator.standard_normal(self._chance.shape)
        world, team = self._world, slice(self._rows.start, self._rows.stop)
        chance = self._chance if self._is_shadowed else None
        self.links = links(self._settings, world.poses[team], self._barriers(), chance)
        works = self._works(step)
        self.links &= works[:, None] & works[None, :]

    def find_station(self, *, draws: bool = False) -> None:
        """Find the robots that reach the station, at the start of the first robot."""
        if draws and self._is_shadowed:
            self._station_chance = self._station_generator.standard_normal(len(self.station_links))
        world, team = self._world, slice(self._rows.start, self._rows.stop)
        is_linked = links_to(
            self._settings,
            world.poses[team],
            world.starts[self._rows.start],
            self._barriers(),
            self._station_chance if self._is_shadowed else None,
        )
        self.station_links = is_linked & self._works(int(world.steps[self._episode]))

    def _barriers(self) -> Raster:
        """Return the solid cells of the floor in the laser's plane, including doors that are not fully open."""
        floor = self._world.floors[self._episode]
        assert floor is not None
        population = getattr(self._world, "population", None)  # which worlds of users need not have
        crowd = crowd_of(population, self._episode) if asks_for_walls(self._settings) else None
        if crowd is None or not (crowd.opened < 1.0).any():
            return floor.laser
        solid = floor.laser.solid.copy()
        draw_segments(solid, floor.laser.origin, floor.laser.resolution, crowd.leaves[crowd.opened < 1.0], 1)
        return Raster(solid, floor.laser.origin, floor.laser.resolution)

    def reached(self) -> NDArray[np.bool_]:
        """Return whom the station reaches, from robot to robot, (robots,)."""
        reached, known = self.station_links.copy(), np.zeros_like(self.station_links)
        while (reached != known).any():
            known = reached
            reached = known | self.links[known].any(axis=0)
        return reached

    def is_lost(self, *, is_of_station: bool) -> bool:
        """Draw whether a message is lost, one of the station or between robots."""
        generator = self._station_generator if is_of_station else self._generator
        return self._settings.loss > 0.0 and bool(generator.random() < self._settings.loss)

    def _works(self, step: int) -> NDArray[np.bool_]:
        """Return which robots' radios work, (robots,)."""
        world = self._world
        return np.array(
            [world.failed[row] == 0 and not has_fault(world.faults[row], DEAD_RADIO, step) for row in self._rows]
        )


BLOCK = 64
"""Cells of a block of a map."""

POSE_BYTES = 32
"""A message with a pose: x, y, theta and the time, 8 bytes each."""

HEADER_BYTES, BLOCK_BYTES = 32, 4 + BLOCK
"""A message with a part of a map: sender, owner of the map, step, number of blocks.

Each block is its number and a byte for each cell.
"""

STATUS_BYTES = 80
"""Bytes of the status that a robot sends with its map.

The status is pose, target and three figures, 8 bytes each, and the robot's states.
"""


@kernel
def _differing_blocks(source: Array, target: Array, low: int, high: int, found: Array) -> int:
    """Fill ``found`` with the differing blocks of two maps; return their count.

    Blocks are numbered, over rows ``low`` to ``high``.
    """
    columns, count = source.shape[1], 0
    words = columns // 64
    for row in range(low, high):
        for word in range(words):
            for column in range(64 * word, 64 * word + 64):
                if source[row, column] != target[row, column]:
                    found[count] = row * words + word
                    count += 1
                    break
    return count


@dataclass(frozen=True, slots=True)
class _Message:
    """Something that is being sent: a pose, or blocks of a map if there are any.

    Attributes
    ----------
    arrives : int
        The step at which it is there.
    receiver, source : int
        The receiving robot, and the robot that the data describe.
    step : int
        The step at which it was true.
    pose : (3,) float64 or None
        x, y, theta as the source believed [m, rad].
    has_ended : bool
        Whether the source had ended.
    blocks, cells : (blocks,) int64, (blocks, 64) int8
        Blocks of the source's map.
    status : Status or None
        The status that the source reported with its map.
    sparse : SparseShare or None
        The source's sparse map, None if it makes none.
    """

    arrives: int
    receiver: int
    source: int
    step: int
    pose: NDArray[np.float64] | None
    has_ended: bool
    blocks: NDArray[np.int64]
    cells: NDArray[np.int8]
    status: Status | None = None
    sparse: SparseShare | None = None


NO_BLOCKS, NO_CELLS = np.zeros(0, np.int64), np.zeros((0, BLOCK), np.int8)


def differing_blocks(held: NDArray[np.int8], copy: NDArray[np.int8]) -> tuple[NDArray[np.int64], NDArray[np.int8]]:
    """Return the blocks in which a map differs from an older copy.

    Their numbers (blocks,) and their cells (blocks, 64).
    """
    # A correction of the past may have emptied rows that the receiver still holds.
    used = np.flatnonzero(held.view(np.uint64).any(axis=1) | copy.view(np.uint64).any(axis=1))
    low, high = (int(used[0]), int(used[-1]) + 1) if len(used) else (0, 0)
    found = np.empty((high - low) * (held.shape[1] // BLOCK), np.int64)
    blocks = found[: _differing_blocks(held, copy, low, high, found)].copy()
    return blocks, held.reshape(-1, BLOCK)[blocks]


NEVER = -2
"""Step of a message that never came.

The scan at the start is of step 0, before which is -1.
"""

CONTACT_S = 0.5
"""A teammate's pose is good for driving round it for this long [s]."""


class Exchange:
    """The radio traffic of one episode.

    Parameters
    ----------
    simulation : Simulation
        The simulation with the robots.
    settings : ExplorationSettings
        The team and its radio.
    episode : int
        Which episode of the world.

    Attributes
    ----------
    heard, heard_at : (robots, robots, 3) float64, (robots, robots) int64
        The last pose of each robot that reached each other (receiver, source), and the step at which it was
        true.
    heard_ended : (robots, robots) bool
        Whether the source reported that it has ended.
    copies : list of list of (rows, columns) int8 arrays
        Copy of each map held by each robot and, last, the station (receiver, source); a robot's own map is not a
        copy.
    copied_at : (robots + 1, robots) int64
        The step at which each copy was true.
    statuses : list of list of Status or None
        Last status of each robot with its map, as held by each robot and, last, the station (receiver, source).
    sparse : list of list of SparseShare or None
        Copy of each sparse map, in the same order; None if none has come. A robot's own is as of the last exchange.
    report_of : callable or None
        Takes the number of a robot and returns its status; if None, robots do not report and there is no station.
    windows : (robots, 4) int64
        Part of the copies held by each robot that has changed since it was last taken: rows and columns, low and
        high.
    bytes_sent : (robots,) int64
        Bytes that each robot has sent to others, lost ones included.
    bytes_reported : (robots,) int64
        Additional bytes that each robot has sent for the station: to the station, and with maps to other robots.
    """

    def __init__(self, simulation: Simulation, settings: ExplorationSettings, episode: int = 0) -> None:
        self._world, self._beliefs = simulation.world, simulation.beliefs
        self._settings, self._episode = settings, episode
        robots = settings.robots
        self._first = episode * robots
        self._period = max(round(settings.radio.period_s / settings.time_step), 1)
        self._latency = round(settings.radio.latency_s / settings.time_step)
        self._radio = RadioLinks(simulation.world, settings, episode)
        self.report_of: Callable[[int], Status] | None = None
        self.start(0)

    def __getstate__(self) -> dict[str, Any]:
        # The station of a copy sets its own callback.
        return {**self.__dict__, "report_of": None}

    @property
    def links(self) -> NDArray[np.bool_]:
        """Links that worked in the last step, (robots, robots): sender, receiver."""
        return self._radio.links

    @property
    def station_links(self) -> NDArray[np.bool_]:
        """Robots that reached the station at its last maps or order, (robots,)."""
        return self._radio.station_links

    def start(self, seed: int) -> None:
        """Begin an episode in which no robot knows anything of the others.

        Chance comes from ``seed``.
        """
        robots, maps = (
            self._settings.robots,
            self._beliefs.log_odds[self._first : self._first + self._settings.robots],
        )
        self._radio.start(seed)
        self._in_transit: list[_Message] = []
        self.heard, self.heard_at = np.zeros((robots, robots, 3)), np.full((robots, robots), NEVER, np.int64)
        self.heard_ended = np.zeros((robots, robots), np.bool_)
        self.copies = [
            [log_odds if i == j else np.zeros((0, BLOCK), np.int8) for j, log_odds in enumerate(maps)]
            for i in range(robots + 1)
        ]
        self.copied_at = np.full((robots + 1, robots), NEVER, np.int64)
        self.statuses: list[list[Status | None]] = [[None] * robots for _ in range(robots + 1)]
        self.sparse: list[list[SparseShare | None]] = [[None] * robots for _ in range(robots + 1)]
        self.windows = np.zeros((robots, 4), np.int64)
        for robot in range(robots):
            self._forget_changes(robot)
        self.bytes_sent, self.bytes_reported = np.zeros(robots, np.int64), np.zeros(robots, np.int64)

    def take_window(self, robot: int) -> NDArray[np.int64]:
        """Return the window of a robot's copies that changed since the last call.

        It holds rows and columns (4,), and is empty if low is not below high.
        """
        window: NDArray[np.int64] = self.windows[robot].copy()
        self._forget_changes(robot)
        return window

    def _forget_changes(self, robot: int) -> None:
        rows, columns = self._beliefs.log_odds[self._first + robot].shape
        self.windows[robot] = (rows, 0, columns, 0)

    def step(self, sparse: Sequence[SparseShare | None] = ()) -> None:
        """Let the robots talk, after they have sensed.

        Called once in every step of the episode and at its start.

        Parameters
        ----------
        sparse : sequence of SparseShare or None
            The sparse map of each robot that makes one; empty if nobody does.
        """
        step = int(self._world.steps[self._episode])
        is_time = step % self._period == 0
        self._radio.find(step, draws=is_time)
        if is_time and self.report_of is not None:
            self._radio.find_station(draws=True)
        self._send_poses(step)
        if is_time:
            for robot, share in enumerate(sparse):
                self.sparse[robot][robot] = share
            self._send_maps(step)
        due = [message for message in self._in_transit if message.arrives <= step]
        self._in_transit = [message for message in self._in_transit if message.arrives > step]
        for message in due:
            self._receive(message)

    def order_delay(self, receiver: int) -> int | None:
        """Return the delay in steps of an order of the station sent now to a robot.

        An order goes over links that work now, from robot to robot; None if the links do not exist, or it is lost by
        chance.
        """
        self._radio.find_station()
        is_reached, is_lost = self._radio.reached()[receiver], self._radio.is_lost(is_of_station=True)
        return self._latency if is_reached and not is_lost else None

    def _send(self, message: _Message) -> None:
        if not self._radio.is_lost(is_of_station=message.receiver == self._settings.robots):
            self._in_transit.append(message)

    def _send_poses(self, step: int) -> None:
        for sender in np.flatnonzero(self.links.any(axis=1)).tolist():
            row = self._first + sender
            pose, has_ended = self._beliefs.believed[row].copy(), bool(self._world.flags[row] & ENDED)
            # A pose is sent to all at once.
            self.bytes_sent[sender] += POSE_BYTES
            for receiver in np.flatnonzero(self.links[sender]).tolist():
                self._send(_Message(step + self._latency, receiver, sender, step, pose, has_ended, NO_BLOCKS, NO_CELLS))

    def _send_maps(self, step: int) -> None:
        robots = self._settings.robots
        np.fill_diagonal(self.copied_at, step)
        if self.report_of is not None:
            for robot in range(robots):
                self.statuses[robot][robot] = self.report_of(robot)
        # Only data held when the exchange began are sent: no data pass two links at once.
        chosen = [
            (self._best_sender(receiver, source), receiver, source)
            for receiver in range(robots if self.report_of is None else robots + 1)
            for source in range(robots)
            if receiver != source
        ]
        messages = [
            (sender, self._part_to_send(sender, receiver, source, step))
            for sender, receiver, source in chosen
            if sender is not None
        ]
        for sender, message in messages:
            copy = self.sparse[message.receiver][message.source]
            size = HEADER_BYTES + BLOCK_BYTES * len(message.blocks) + bytes_to_send(message.sparse, copy)
            is_to_station = message.receiver == robots
            self.bytes_sent[sender] += 0 if is_to_station else size
            self.bytes_reported[sender] += (size if is_to_station else 0) + (
                0 if message.status is None else STATUS_BYTES
            )
            self._send(message)

    def _best_sender(self, receiver: int, source: int) -> int | None:
        """Return which of the robots that reach a receiver holds the latest copy of a map.

        None if no robot has a later one, or it is being sent.
        """
        if any(
            message.pose is None and (message.receiver, message.source) == (receiver, source)
            for message in self._in_transit
        ):
            return None
        robots = self._settings.robots
        is_linked = self.station_links if receiver == robots else self.links[:, receiver]
        held_at = np.where(is_linked, self.copied_at[:robots, source], NEVER)
        best = int(np.argmax(held_at))
        return best if held_at[best] > self.copied_at[receiver, source] else None

    def _part_to_send(self, sender: int, receiver: int, source: int, step: int) -> _Message:
        """Return the part of a map that a sender holds and the receiver lacks."""
        held, copy = self.copies[sender][source], self._copy_of(receiver, source)
        true_at, status = int(self.copied_at[sender, source]), self.statuses[sender][source]
        arrives = step + self._latency
        blocks, cells = differing_blocks(held, copy)
        sparse = self.sparse[sender][source]
        return _Message(arrives, receiver, source, true_at, None, False, blocks, cells, status, sparse)

    def _copy_of(self, receiver: int, source: int) -> NDArray[np.int8]:
        """Return a robot's copy of another's map, blank at first."""
        if self.copies[receiver][source].size == 0:
            self.copies[receiver][source] = np.zeros(self._beliefs.log_odds[self._first + source].shape, np.int8)
        return self.copies[receiver][source]

    def _receive(self, message: _Message) -> None:
        receiver, source = message.receiver, message.source
        if message.pose is not None:
            if message.step > self.heard_at[receiver, source]:
                self.heard[receiver, source], self.heard_at[receiver, source] = message.pose, message.step
                self.heard_ended[receiver, source] = message.has_ended
            return
        if message.step <= self.copied_at[receiver, source]:
            return
        copy = self._copy_of(receiver, source)
        copy.reshape(-1, BLOCK)[message.blocks] = message.cells
        self.copied_at[receiver, source], self.statuses[receiver][source] = message.step, message.status
        self.sparse[receiver][source] = message.sparse
        if len(message.blocks) and receiver < self._settings.robots:
            rows, words = np.divmod(message.blocks, copy.shape[1] // BLOCK)
            window = self.windows[receiver]
            window[0], window[1] = min(window[0], rows.min()), max(window[1], rows.max() + 1)
            window[2], window[3] = (
                min(window[2], BLOCK * words.min()),
                max(window[3], BLOCK * (words.max() + 1)),
            )
