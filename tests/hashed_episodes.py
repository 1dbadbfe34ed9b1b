"""Episodes of every kind, run by public names alone: modules may move. What they tell goes into a ledger."""

import contextlib
import dataclasses
import importlib.metadata
import io
import json
import os
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

os.environ.setdefault("LIDARIUM_FLOOR_STORE", "off")

import gymnasium
import numpy as np
import pytest
from all_observed import ALL
from episode_ledger import Ledger, named

import lidarium
from lidarium.agents import PerRobot, Stop
from lidarium.evaluation.episodes.watching import Watcher

SEED = 11
SMALL: dict[str, Any] = {"map_cells": 64, "stop_coverage": None, "starts": "fixed"}

OLD_OFFERS: dict[str, Any] = {"frontiers": 16, "least_frontier": 0.1, "frontiers_by_size": 0.0}
"""What the level of frontiers offered when the hashes were made, and version 0 of the ids still does."""


@dataclasses.dataclass(frozen=True)
class Case:
    """An episode: who runs it."""

    run: Callable[[Ledger], None]
    block: int


def drawn_floor() -> Any:
    """Return two rooms with a table, drawn by hand."""

    def box(x: float, y: float, width: float, depth: float) -> np.ndarray:
        return np.array([[x, y], [x + width, y], [x + width, y + depth], [x, y + depth]], float)

    walls = [
        box(0, 0, 8, 0.2),
        box(0, 5.8, 8, 0.2),
        box(0, 0, 0.2, 6),
        box(7.8, 0, 0.2, 6),
        box(4, 0, 0.15, 4.6),
    ]
    solids = (*map(named("Solid"), walls), named("Solid")(box(1.5, 2.0, 1.2, 0.8), 0.4, 0.75))
    return named("Floor")(
        "two_rooms", (0.0, 0.0, 8.0, 6.0), solids, starts=np.array([[1.0, 1.0, 0.0], [7.0, 1.0, 1.5]])
    )


def built(options: Mapping[str, Any], level: str = "velocity") -> dict[str, Any]:
    """Return options in which values that need a documented name have been made."""
    offers = OLD_OFFERS if level == "frontier" else {}
    return {
        "observe": ALL,
        **SMALL,
        **offers,
        **{key: value() if callable(value) else value for key, value in options.items()},
    }


def part(name: str, **values: Any) -> Callable[[], Any]:
    """Return how to make a documented part of the settings."""
    return lambda: named(name)(**values)


def faults(robots: int = 3) -> Any:
    """Return scheduled faults of every kind, for three robots, and random ones."""
    kinds = ("laser_dropout", "blind_sector", "stuck_wheel", "kidnapping", "dead_radio", "dead_robot")
    schedule = tuple(
        named("Fault")(kind=kind, robot=n % 3, at_s=2.0 + 2 * n, lasts_s=None if n > 2 else 2.0)
        for n, kind in enumerate(kinds)
        if n % 3 < robots
    )
    return named("FaultSettings")(schedule=schedule, laser_dropout=120.0, stuck_wheel=60.0)


def choose(level: str, draws: np.random.Generator, step: int, mask: Any, before: Any) -> Any:
    """Draw an action: speeds hold for ten steps and go forward mostly, so that robots get on."""
    if level == "frontier":
        return int(draws.choice(np.flatnonzero(mask)))
    if level == "waypoint":
        return draws.uniform(-1.0, 1.0, 2).astype(np.float32)
    return before if step % 10 else draws.uniform((-0.2, -0.4), (0.8, 0.4)).astype(np.float32)


def order(env: Any, step: int) -> None:
    """Give the orders of a station at some steps."""
    if step in (3, 5, 7, 12) and "robot_0" in env.agents:
        kind = {3: "GO_TO", 5: "PAUSE", 7: "RESUME", 12: "STOP"}[step]
        target = named("Target")(0.5, 0.3) if kind == "GO_TO" else None
        env.order("robot_0", named("Order")(named("OrderKind")[kind], target, "golden"))


def team(
    floor: Any,
    steps: int,
    level: str = "velocity",
    merged: Any = None,
    ordered: bool = False,
    **options: Any,
) -> Case:
    """Return an episode of ``lidarium.parallel_env`` with drawn actions."""

    def run(ledger: Ledger) -> None:
        env = lidarium.parallel_env(floor() if callable(floor) else floor, level=level, **built(options, level))
        if merged is not None:
            env = named("MergedMaps")(env, named("MergingSettings")(period_s=2.0, known_starts=merged))
        draws, actions = np.random.default_rng(SEED), {}
        outcome = env.reset(seed=SEED)
        ledger.told(outcome)
        for step in range(steps):
            if not env.agents:  # a second episode goes on with the same generator
                outcome = env.reset()
                ledger.told(outcome)
            if ordered:
                order(env, step)
            actions = {
                agent: choose(level, draws, step, outcome[0][agent].get("action_mask"), actions.get(agent, np.zeros(2)))
                for agent in env.agents
            }
            outcome = env.step(actions)
            ledger.told(outcome)

    return Case(run, 50 if level == "velocity" else 5)


def solo(name: str, level: str, steps: int, **options: Any) -> Case:
    """Return an episode of one robot by Gymnasium's register."""

    def run(ledger: Ledger) -> None:
        env = gymnasium.make(f"lidarium/{name}-v0", **built(options))
        draws, action = np.random.default_rng(SEED), np.zeros(2)
        outcome: Any = env.reset(seed=SEED)
        ledger.told(outcome)
        for step in range(steps):
            action = choose(level, draws, step, outcome[0].get("action_mask"), action)
            outcome = env.step(action)
            ledger.told(outcome)
            if outcome[2] or outcome[3]:
                break

    return Case(run, 50 if level == "velocity" else 5)


def turns(floor: str, steps: int, **options: Any) -> Case:
    """Return an episode in PettingZoo's turn-based form."""

    def run(ledger: Ledger) -> None:
        env = lidarium.env(floor, **built(options))
        draws = np.random.default_rng(SEED)
        env.reset(seed=SEED)
        for _ in range(steps):
            if not env.agents:
                break
            ledger.told(env.last())
            is_over = env.terminations[env.agent_selection] or env.truncations[env.agent_selection]
            env.step(None if is_over else draws.uniform((-0.2, -0.4), (0.8, 0.4)).astype(np.float32))

    return Case(run, 50)


def rows(
    floor: str,
    steps: int,
    level: str = "velocity",
    make: Callable[..., Any] | None = None,
    **options: Any,
) -> Case:
    """Return episodes of ``lidarium.vector_env``, some of which end and begin anew."""

    def run(ledger: Ledger) -> None:
        env = (make or lidarium.vector_env)(3, floor=floor, level=level, **built(options, level))
        draws, before = np.random.default_rng(SEED), [np.zeros(2)] * env.num_envs
        outcome = env.reset(seed=SEED)
        ledger.told(outcome)
        for step in range(steps):
            masks = outcome[0].get("action_mask", [None] * env.num_envs)
            before = [choose(level, draws, step, mask, old) for mask, old in zip(masks, before, strict=True)]
            outcome = env.step(np.array(before))
            ledger.told(outcome)
        env.close()

    return Case(run, 50 if level == "velocity" else 5)


def made_rows(episodes: int, floor: str, level: str, **options: Any) -> Any:
    """Make rows of one robot by Gymnasium's register."""
    del level
    return gymnasium.make_vec("lidarium/WaypointExploration-v0", episodes, floor=floor, **options)


def learner_rows(floor: str, steps: int, **options: Any) -> Case:
    """Return the rows for stable-baselines3."""

    def run(ledger: Ledger) -> None:
        pytest.importorskip("stable_baselines3")
        env = lidarium.sb3_vec_env(3, floor, **built(options))
        draws, before = np.random.default_rng(SEED), [np.zeros(2)] * env.num_envs
        env.seed(SEED)
        ledger.add("observations", env.reset())
        for step in range(steps):
            before = [choose("velocity", draws, step, None, old) for old in before]
            observations, rewards, dones, infos = env.step(np.array(before))
            ledger.told((observations, rewards, dones, None, {"rows": infos}))
        env.close()

    return Case(run, 50)


def formed(face: str, level: str, seed: int, steps: int, **options: Any) -> Case:
    """Return episodes with conventions, merged maps, drawn settings or another backend, through one face.

    ``face`` is ``parallel``, ``rows`` or ``learner``. Actions are drawn for each row, masks are taken from
    where the conventions put them.
    """

    def run(ledger: Ledger) -> None:
        values = built(options, level)
        floats = values.get("comm", 0)
        if level == "frontier" and (floats or "observation" in values):
            values.setdefault("action_mask", "infos")
        if values.get("backend") == "bullet":
            pytest.importorskip("pybullet")
        draws, held = np.random.default_rng(seed), dict[Any, Any]()

        def drawn(row: Any, step: int, mask: Any) -> Any:
            held[row] = choose(level, draws, step, mask, held.get(row, np.zeros(2)))
            message = draws.uniform(-1.0, 1.0, floats).astype(np.float32)
            if not floats:
                return held[row]
            return (
                {"action": held[row], "message": message}
                if level == "frontier"
                else np.concatenate([np.asarray(held[row], np.float32), message])
            )

        if face == "parallel":
            env = lidarium.parallel_env(level=level, **values)
            outcome: Any = env.reset(seed=seed)
            ledger.told(outcome)
            for step in range(steps):
                if not env.agents:
                    outcome = env.reset()
                    ledger.told(outcome)
                masks = {agent: mask_in(outcome[0][agent], outcome[-1].get(agent, {})) for agent in env.agents}
                outcome = env.step({agent: drawn(agent, step, masks[agent]) for agent in env.agents})
                ledger.told(outcome)
            env.close()
            return
        if face == "learner":
            pytest.importorskip("stable_baselines3")
            env = lidarium.sb3_vec_env(3, level=level, **values)
            env.seed(seed)
            observations, infos = env.reset(), env.reset_infos
        else:
            env = lidarium.vector_env(3, level=level, **values)
            observations, infos = env.reset(seed=seed)
        ledger.told((observations, {"rows": infos}))
        for step in range(steps):
            actions = [drawn(row, step, mask_in(observations, infos, row)) for row in range(env.num_envs)]
            whole: Any = (
                {name: np.array([each[name] for each in actions]) for name in actions[0]}
                if isinstance(actions[0], dict)
                else np.array(actions)
            )
            outcome = env.step(whole)
            observations, infos = outcome[0], outcome[-1]
            ledger.told((*outcome, None, {})[:5] if face == "rows" else (*outcome[:3], None, {"rows": infos}))
        env.close()

    return Case(run, 20 if level == "velocity" else 4)


def mask_in(observation: Any, infos: Any, row: int | None = None) -> Any:
    """Return the mask of actions of an agent or a row, from observations or infos; None if there is none."""
    told = infos[row] if isinstance(infos, list | tuple) else infos
    for place in (observation, told):
        if isinstance(place, Mapping) and "action_mask" in place:
            mask = np.asarray(place["action_mask"])
            return mask if row is None or mask.ndim == 1 else mask[row]
    return None


def true_motion(env: Any) -> np.ndarray:
    """Return x, y, theta, speed and turn rate of each robot, (robots * 5,)."""
    return np.concatenate([env.world.poses, env.world.velocities], axis=1).ravel()


class Overseen(Watcher):
    """Hashes the commands and true states of all steps, and who is live."""

    def __init__(self, ledger: Ledger) -> None:
        self._ledger = ledger

    def begin(self, env: Any) -> None:
        self.outcome(env)

    def step(self, env: Any, commands: Any) -> None:
        self._ledger.add("motion", {"commands": commands, "state": true_motion(env)})
        self._ledger.tick()

    def outcome(self, env: Any) -> None:
        self._ledger.add("ends", {"live": env.agents})


class Overheard:
    """A policy, and what it is shown."""

    def __init__(self, policy: Any, ledger: Ledger) -> None:
        self._policy, self._ledger = policy, ledger

    def __getattr__(self, name: str) -> Any:
        return getattr(self._policy, name)

    def act(self, observations: Any) -> Any:
        """Hash what is seen, and who ends and why; then decide."""
        self._ledger.add("observations", observations)
        actions = self._policy.act(observations)
        self._ledger.add("stops", {agent: act.reason for agent, act in actions.items() if isinstance(act, Stop)})
        return actions


def policy(
    name: str,
    floor: str,
    steps: int,
    each: bool = False,
    setup: Mapping[str, Any] | None = None,
    merged: bool = False,
    **options: Any,
) -> Case:
    """Return an episode that a policy of the catalogue runs, with commands and true states of all steps."""

    def run(ledger: Ledger) -> None:
        def made() -> Any:
            return lidarium.policy(name, **(setup or {}))

        settings = named("make_settings")(**{**built(options), "max_cycles": steps})
        env = named("WatchedExploration")(floor, settings, watchers=[Overseen(ledger)])
        heard = Overheard(PerRobot(made) if each else made(), ledger)
        merging = named("MergingSettings")(period_s=2.0) if merged else None
        episode = named("run_episode")(heard, env, SEED, merging=merging)
        ledger.add("infos", {"given_up": episode.given_up, "merges": episode.merges})

    return Case(run, 50)


def command(line: str) -> Case:
    """Return an episode of ``lidarium run``: its result, map, record and log of decisions."""

    def run(ledger: Ledger) -> None:
        (script,) = importlib.metadata.entry_points(group="console_scripts", name="lidarium")
        with tempfile.TemporaryDirectory() as folder, contextlib.redirect_stdout(io.StringIO()) as said:
            code = script.load()(["run", *line.split(), "--seed", str(SEED), "--record", "--out", folder])
            assert code == 0, said.getvalue()
            out = Path(folder)
            ledger.add("result", json.loads((out / "result.json").read_text()))
            ledger.add("map", {name: (out / name).read_bytes().hex() for name in ("map.pgm", "map.yaml")})
            if (out / "decisions.jsonl").exists():
                ledger.add(
                    "decisions",
                    [json.loads(text) for text in (out / "decisions.jsonl").read_text().splitlines()],
                )
            with np.load(out / "episode.npz", allow_pickle=False) as record:
                tables = (
                    "commands",
                    "pose_steps",
                    "poses",
                    "coverage",
                    "map_steps",
                    "map_counts",
                    "map_places",
                    "map_known",
                    "map_occupied",
                )
                ledger.add("record", {name: record[name] for name in tables})

    return Case(run, 50)
