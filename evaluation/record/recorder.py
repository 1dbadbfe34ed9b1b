"""Records an episode as it runs: the data to run it again, and to show it."""

import json
import math
import platform
from collections.abc import Sequence
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

import lidarium
from lidarium.agents.catalogue import make_policy
from lidarium.agents.policy import Policy
from lidarium.agents.report import GivenUp
from lidarium.envs.engine.tally import TRACK_PERIOD_S
from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.floors.floor import Floor
from lidarium.envs.onboard.radio.messages import Orders
from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.envs.settings.making import make_settings
from lidarium.envs.simulation.maps_on_floor import cells_beyond
from lidarium.envs.simulation.people.crowd import Crowd, crowd_of
from lidarium.evaluation.episodes.events import operating_events, place_of
from lidarium.evaluation.episodes.runner import run_episode
from lidarium.evaluation.episodes.settings_identity import settings_sha256
from lidarium.evaluation.episodes.watching import WatchedExploration, Watcher
from lidarium.evaluation.record.episode_record import FORMAT, CrowdTrack, DisplayTrack, EpisodeRecord, MapChanges
from lidarium.evaluation.record.file import write_record
from lidarium.evaluation.record.replay import state_sha256
from lidarium.mapping.grids.map_deltas import OverlaidMaps, note_changes, note_overlaid_changes

PACKAGES = {"bullet": "pybullet"}
"""The package that moves the bodies, by backend."""


def made_with(backend: str) -> dict[str, str]:
    """Return versions of numpy, numba and the physics engine, and the processor."""
    package = PACKAGES.get(backend)
    bodies = {} if package is None else {package: version(package)}
    return {"numpy": np.__version__, "numba": numba.__version__, **bodies, "machine": platform.machine()}


FAR = 1e5
"""Maximum distance from a robot at which a map that was rendered again may have changed [m]."""


class MapSampler:
    """Follows the team's map of an episode; the first sample is taken when it is made.

    The map is the sign of the sum of the robots' log-odds, those that do not know their starts overlaid over
    the floor by their true starts, as in ``result.json`` and the map files.

    Attributes
    ----------
    origin : (x, y)
        Lower left corner of cell (0, 0) in the floor's frame [m].
    shape : (rows, words)
        Rows of the map, and words of 64 cells in a row.
    """

    def __init__(self, env: ExplorationEnv, period_s: float) -> None:
        world, settings = env.world, env.settings
        tables = world.floors[0]
        assert tables is not None
        self.origin: tuple[float, float] = tables.laser.origin
        self.shape: tuple[int, int] = (
            env.score.counted_masks[0].shape[0],
            env.score.counted_masks[0].shape[1],
        )
        self._env, self._time_step, self._resolution = (
            env,
            settings.time_step,
            settings.occupancy.resolution,
        )
        self._frame = np.array([*self.origin, self._resolution])
        self._known, self._occupied = np.zeros(self.shape, np.uint64), np.zeros(self.shape, np.uint64)
        self._buffer = np.empty((self.shape[0] * self.shape[1], 3), np.uint64)
        # Between two samples a robot gets no farther from both positions than half of its maximum path.
        self._reach = (
            settings.lidar.range_max
            + settings.speed_limits[:, 0].max() * (0.5 * period_s + (settings.scan_steps - 1) * settings.time_step)
            + 4 * self._resolution
        )
        self._last = env.beliefs.believed[:, :2].copy()
        self._is_overlaid = not settings.known_starts
        self._maps = env.beliefs.belief_rows.copy()
        if settings.known_starts:
            for row in range(settings.robots):
                first_row, first_column = cells_beyond(env.simulation, row, 0)
                self._maps[row, 0] += first_row * self._maps[row, 2] + first_column
        self._renderings = env.beliefs.renderings.copy()
        self._placements = _overlays_of(env, self.origin)
        self._before = (
            [np.zeros(log_odds.shape, np.int8) for log_odds in env.beliefs.log_odds] if self._is_overlaid else []
        )
        self._before_at = np.array([log_odds.ctypes.data for log_odds in self._before], np.int64)
        self._steps: list[int] = []
        self._changes: list[NDArray[np.uint64]] = []
        self.sample()

    def sample(self) -> None:
        """Take a sample; once in a step."""
        world = self._env.world
        step = int(world.steps[0])
        if self._steps and step <= self._steps[-1]:
            return
        planes = (self._known, self._occupied, self._buffer)
        is_new = not np.array_equal(self._renderings, self._env.beliefs.renderings)
        reach = FAR if is_new else self._reach
        self._renderings[:] = self._env.beliefs.renderings
        if self._is_overlaid:
            overlaid = OverlaidMaps(self._env.beliefs.belief_rows, self._before_at, self._placements, self._resolution)
            count = note_overlaid_changes(overlaid, self._env.beliefs.believed, self._last, reach, *planes)
        else:
            count = note_changes(self._maps, self._env.beliefs.believed, self._last, reach, self._frame, *planes)
        self._steps.append(step)
        self._changes.append(self._buffer[:count].copy())

    def changes(self) -> MapChanges:
        """Return all samples so far."""
        changes = np.concatenate(self._changes)
        counts = np.array([len(change) for change in self._changes], np.int64)
        places = changes[:, 0].astype(np.int64)
        # Words above each other are alike, so that in this order they take less room when they are
        # compressed.
        order = np.lexsort((places, np.repeat(np.arange(len(counts)), counts)))
        times = np.array(self._steps) * self._time_step
        return MapChanges(*self.shape, times, counts, places[order], changes[order, 1], changes[order, 2])


def _overlays_of(env: ExplorationEnv, origin: tuple[float, float]) -> NDArray[np.float64]:
    """Return how maps in the frames of the starts lie over the floor's lattice.

    It is in the form that ``note_overlaid_changes`` takes.
    """
    world = env.world
    return np.array(
        [
            (*origin, x, y, math.cos(theta), math.sin(theta), *own_origin)
            for (x, y, theta), own_origin in zip(world.starts, env.beliefs.origins, strict=True)
        ]
    )


MAP_PERIOD_S = 2.0
"""Time between samples of the team's map [s]."""


class Recorder(Watcher):
    """Records an episode.

    Notes
    -----
    An episode is its draws at the beginning (floor, starts, seed of the noise, goal), the speeds that
    its robots were driven at, and when robots ended. Nothing else enters the world, so neither the policy nor
    the onboard software is needed to run it again.
    """

    def __init__(
        self,
        policy: str = "",
        seed: int | None = None,
        floor: str | Path | None = None,
        image_resolution: float | None = None,
    ) -> None:
        self._about = {
            "policy": policy,
            "seed": seed,
            "floor_source": None if floor is None else str(floor),
            "image_resolution": image_resolution,
        }
        self._env: ExplorationEnv | None = None

    def begin(self, env: ExplorationEnv) -> None:
        """Begin a new record, with the map of the scan at the start."""
        world, settings = env.world, env.settings
        self._env = env
        self._commands = bytearray()
        self._endings: list[tuple[int, str, str]] = []
        self._events: list[dict[str, Any]] = []
        self._collisions = world.collisions.copy()
        self._noted_collisions = self._collisions.tobytes()
        self._live, self._decided_at = len(env.agents), 0
        self._targets: list[tuple[float, float] | None] = [None] * settings.robots
        self._given_up: set[GivenUp] = set()
        self._last_given_up: list[GivenUp] = []
        self._map_steps = max(round(MAP_PERIOD_S / settings.time_step), 1)
        self._steps_to_sample = self._map_steps
        self._maps = MapSampler(env, MAP_PERIOD_S)
        self._crowds: list[tuple[float, Crowd]] = []
        self._note_crowd(env)

    def step(self, env: ExplorationEnv, commands: NDArray[np.float64]) -> None:
        """Note how the robots were driven, contacts that began, and the map.

        The map is noted from time to time.
        """
        self._commands += commands.tobytes()
        world = env.world
        self._note_crowd(env)
        if world.collisions.tobytes() != self._noted_collisions:
            self._note_contacts(env)
        self._steps_to_sample -= 1
        if not self._steps_to_sample:
            self._steps_to_sample = self._map_steps
            self._maps.sample()

    def outcome(self, env: ExplorationEnv) -> None:
        """Note which robots ended, and why."""
        if len(env.agents) == self._live:
            return
        self._live = len(env.agents)
        known = {agent for _, agent, _ in self._endings}
        step = int(env.world.steps[0])
        self._endings += [
            (step, agent, reason) for agent, reason in env.scorer.ended_because.items() if agent not in known
        ]

    def decision(self, env: ExplorationEnv, orders: Orders | None, given_up: Sequence[GivenUp]) -> None:
        """Note targets of robots, and frontiers given up."""
        time_s = self._decided_at * env.settings.time_step
        self._decided_at = int(env.world.steps[0])
        if orders is not None:
            self._note_targets(env, orders, time_s)
        if given_up and list(given_up) != self._last_given_up:
            self._note_given_up(env, given_up, time_s)

    def note(self, kind: str, time_s: float, agent: str | None, **details: Any) -> None:  # noqa: ANN401
        """Add an event, such as a message or a merge."""
        self._events.append({"time_s": round(time_s, 6), "kind": kind, "agent": agent, **details})

    def finish(self, *, is_interrupted: bool = False) -> EpisodeRecord:
        """Return the record of the episode so far; recording may continue."""
        env = self._env
        if env is None or env.floor is None:
            raise ValueError("the recorder has seen no episode; let it watch an environment from its reset on")
        settings, world = env.settings, env.world
        steps = int(world.steps[0])
        commands = np.frombuffer(self._commands, np.float64).reshape(-1, settings.robots, 2).copy()
        self._maps.sample()
        header = {
            "format": FORMAT,
            "version": lidarium.__version__,
            "made_with": made_with(settings.backend),
            **self._about,
            "floor": env.floor.name,
            "floor_sha256": env.floor.sha256,
            "robots": settings.robots,
            "time_step": settings.time_step,
            # As it comes back from JSON: tuples are lists.
            "settings": json.loads(json.dumps(asdict(settings))),
            "settings_sha256": settings_sha256(settings),
            "starts": world.starts.tolist(),
            "noise_seed": env.seed,
            "goal": None if env.goal is None else list(env.goal),
            "steps": len(commands),
            "counted_cells": int(env.score.counted[0]),
            "map_origin": list(self._maps.origin),
            "map_resolution": settings.occupancy.resolution,
            "map_shape": list(self._maps.shape),
            "endings": [list(ending) for ending in self._endings],
            "interrupted": is_interrupted,
            "predicts": env.perception.predicts,
            # If broken off within a step, the world is ahead of the record.
            "final_sha256": state_sha256(env) if steps == len(commands) else None,
        }
        return EpisodeRecord(header, commands, self._display(env))

    def _display(self, env: ExplorationEnv) -> DisplayTrack:
        scorer, time_step = env.scorer, env.settings.time_step
        track = list(scorer.track)
        if track[-1][0] < scorer.time:
            track.append((scorer.time, env.world.poses.copy()))
        ended = [
            {"time_s": round(step * time_step, 6), "kind": "ended", "agent": agent, "reason": why}
            for step, agent, why in self._endings
        ]
        return DisplayTrack(
            np.array([time for time, _ in track]),
            np.rint(np.stack([poses for _, poses in track]) * 1e3) / 1e3,
            np.array(scorer.curve, np.float64).reshape(-1, 2),
            self._maps.origin,
            env.settings.occupancy.resolution,
            self._maps.changes(),
            sorted([*self._events, *operating_events(env), *ended], key=lambda event: float(event["time_s"])),
            self._crowd(),
        )

    def _note_crowd(self, env: ExplorationEnv) -> None:
        """Sample people and doors as often as poses."""
        crowd = crowd_of(env.simulation.population)
        if crowd is not None:
            step, time_step = int(env.world.steps[0]), env.settings.time_step
            if step % max(round(TRACK_PERIOD_S / time_step), 1) == 0:
                self._crowds.append((step * time_step, crowd))

    def _crowd(self) -> CrowdTrack | None:
        if not self._crowds:
            return None
        times, crowds = zip(*self._crowds, strict=True)
        return CrowdTrack(
            np.array(times),
            np.rint(np.stack([crowd.people for crowd in crowds]) * 1e3) / 1e3,
            np.rint(crowds[0].doors * 1e3) / 1e3,
            np.rint(np.stack([crowd.opened for crowd in crowds]) * 1e2) / 1e2,
        )

    def _note_targets(self, env: ExplorationEnv, orders: Orders, time_s: float) -> None:
        is_ordered, targets = orders.is_ordered.tolist(), orders.targets.tolist()
        for robot, agent in enumerate(env.possible_agents):
            target = (targets[robot][0], targets[robot][1]) if is_ordered[robot] else None
            if target != self._targets[robot]:
                self._targets[robot] = target
                self.note("decision", time_s, agent, **place_of(env, agent, target))

    def _note_given_up(self, env: ExplorationEnv, given_up: Sequence[GivenUp], time_s: float) -> None:
        """Note frontiers that are given up for the first time.

        Frontiers may leave the list if they are seen from elsewhere, and come back.
        """
        self._last_given_up = list(given_up)
        for entry in self._last_given_up:
            if entry not in self._given_up:
                self._given_up.add(entry)
                place = place_of(env, entry.agent, (entry.x, entry.y))
                self.note(
                    "given_up",
                    time_s,
                    entry.agent,
                    **place,
                    size_m=round(entry.size_m, 3),
                    reason=entry.reason,
                )

    def _note_contacts(self, env: ExplorationEnv) -> None:
        collisions = env.world.collisions
        for robot in np.flatnonzero(collisions > self._collisions).tolist():
            self.note("contact", env.scorer.time, env.possible_agents[robot])
        self._collisions, self._noted_collisions = collisions.copy(), collisions.tobytes()


def record(
    policy: str | Policy,
    floor: str | Path | Floor = "apartment",
    settings: ExplorationSettings | None = None,
    seed: int = 0,
    path: Path | str | None = None,
) -> EpisodeRecord:
    """Run an episode and record it, to be run again or shown later.

    Parameters
    ----------
    policy : str or Policy
        Name of a policy, or a policy.
    floor : str, Path or Floor, optional
        Floor as for `load_floor`, "apartment" by default.
    settings : ExplorationSettings, optional
        Settings of the environment; defaults of `make_settings` if None.
    seed : int, optional
        Seed of the environment and the policy, 0 by default.
    path : Path or str, optional
        File (``.npz``) that the record is written to. By default none is written.

    Returns
    -------
    EpisodeRecord
        The record, for `replay`.

    Raises
    ------
    ValueError
        If the policy or the floor is unknown, or robots lack a sensor that the policy needs.

    Examples
    --------
    >>> import lidarium
    >>> recorded = lidarium.record("nearest_frontier", settings=lidarium.make_settings(horizon_s=5.0))
    >>> len(recorded.commands)
    50
    """
    name = policy if isinstance(policy, str) else type(policy).__name__
    recorder = Recorder(name, seed, None if isinstance(floor, Floor) else floor)
    env = WatchedExploration(floor, settings or make_settings(), watchers=[recorder])
    run_episode(make_policy(policy) if isinstance(policy, str) else policy, env, seed)
    found = recorder.finish()
    if path is not None:
        write_record(Path(path), found)
    return found
