"""Records an episode as it runs: what re-runs it, and what can be shown of it."""

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import lidarium
from lidarium.agents.report import GivenUp
from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.onboard.radio.messages import Orders
from lidarium.evaluation.episodes.events import operating_events, place_of
from lidarium.evaluation.episodes.settings_identity import settings_sha256
from lidarium.evaluation.episodes.watching import Watcher
from lidarium.evaluation.record.display import DisplayTrack
from lidarium.evaluation.record.episode_record import FORMAT, EpisodeRecord
from lidarium.evaluation.record.made_with import made_with
from lidarium.evaluation.record.map_sampler import MapSampler
from lidarium.evaluation.record.state import state_sha256

MAP_PERIOD_S = 2.0
"""Time between samples of the team's map [s]."""


class Recorder(Watcher):
    """Records an episode.

    Parameters
    ----------
    policy : str
        Name of the policy, for the header.
    seed : int or None
        The seed that the episode was reset with, for the header; what was drawn with it is recorded itself.
    floor : str, Path or None
        The floor as the user named it, to find it again; without it only floors that are not files are found
        again by themselves.
    image_resolution : float or None
        Side of a pixel [m] where the floor is a plain image.

    Notes
    -----
    An episode is what was drawn at its beginning (floor, starts, seed of the noise, goal), the speeds that
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

    def step(self, env: ExplorationEnv, commands: NDArray[np.float64]) -> None:
        """Note how the robots were driven, contacts that began, and the map.

        The map is noted from time to time.
        """
        self._commands += commands.tobytes()
        world = env.world
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
        """Note where robots were sent next, and what was given up."""
        time_s = self._decided_at * env.settings.time_step
        self._decided_at = int(env.world.steps[0])
        if orders is not None:
            self._note_targets(env, orders, time_s)
        if given_up and list(given_up) != self._last_given_up:
            self._note_given_up(env, given_up, time_s)

    def note(self, kind: str, time_s: float, agent: str | None, **details: Any) -> None:  # noqa: ANN401
        """Add an event, such as a message or a merge.

        Parameters
        ----------
        kind : str
            What happened.
        time_s : float
            When [s].
        agent : str or None
            Whom it concerns, None for the team.
        **details
            What else is to be known, ready for JSON; positions in the floor's frame [m].
        """
        self._events.append({"time_s": round(time_s, 6), "kind": kind, "agent": agent, **details})

    def finish(self, *, is_interrupted: bool = False) -> EpisodeRecord:
        """Return the record of the episode so far; recording may go on.

        Parameters
        ----------
        is_interrupted : bool
            Whether the user broke the episode off.

        Raises
        ------
        ValueError
            Where no episode was begun.
        """
        env = self._env
        if env is None or env.floor is None:
            raise ValueError(
                "the recorder has seen no episode; let it watch an environment from its reset on"
            )
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
            # Broken off within a step, the world is ahead of what was recorded.
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
        )

    def _note_targets(self, env: ExplorationEnv, orders: Orders, time_s: float) -> None:
        is_ordered, targets = orders.is_ordered.tolist(), orders.targets.tolist()
        for robot, agent in enumerate(env.possible_agents):
            target = (targets[robot][0], targets[robot][1]) if is_ordered[robot] else None
            if target != self._targets[robot]:
                self._targets[robot] = target
                self.note("decision", time_s, agent, **place_of(env, agent, target))

    def _note_given_up(self, env: ExplorationEnv, given_up: Sequence[GivenUp], time_s: float) -> None:
        """Note what is given up for the first time.

        What was seen later from elsewhere may leave the list, and come back.
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
