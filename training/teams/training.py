"""A whole training of a team of the zoo, in a folder: rewards, and the best network on the validation floors.

Checkpoints are on the disk. The same call continues an interrupted training.
"""

import itertools
import math
from collections.abc import Generator
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from sb3_contrib import MaskablePPO
from stable_baselines3.common.vec_env import VecEnv, VecMonitor

from lidarium.agents.supervisor.policy import Supervised
from lidarium.agents.zoo.policy import zoo_files
from lidarium.envs.faces.makers import sb3_vec_env, vector_env
from lidarium.envs.floors.catalogue.names import set_floors
from lidarium.envs.floors.floor_choice import FloorChoice
from lidarium.mapping.files.output import clear_unfinished, only_writer, remove_unfinished, write_json, write_text
from lidarium.training.folder import asked_for, begin_folder, versions
from lidarium.training.progress import Progress
from lidarium.training.reinforcement.central_state import CentralState
from lidarium.training.reinforcement.checkpoints import Checkpoint, latest_checkpoint
from lidarium.training.reinforcement.frontier_policy import FrontierPolicy, OptionRanking, TourPolicy
from lidarium.training.reinforcement.learning import learn_on, model_of
from lidarium.training.settings import VALUES, PpoSettings, TeamSettings, ValueSettings

TRAINING_FILE, WEIGHTS_FILE, CARD_FILE, CURVE_FILE = "training.json", "weights.safetensors", "card.json", "curve.csv"
CHECKPOINTS, TENSORBOARD = "checkpoints", "tensorboard"
LIBRARIES = ("numpy", "numba", "torch", "stable-baselines3", "sb3-contrib")

POLICIES: dict[str, type[FrontierPolicy]] = {each.ranking.level: each for each in (FrontierPolicy, TourPolicy)}
"""Policies that learn, by their level."""

LEARNING_WORLD_SEED = 7
"""Seeds of the episodes behind a checkpoint are drawn with it."""


@dataclass(frozen=True, slots=True)
class TeamTraining:
    """A training that runs into a folder."""

    settings: TeamSettings
    folder: Path

    def run(self) -> Generator[Progress, None, None]:
        """Learn from the last checkpoint on, and yield each step when it is on the disk."""
        try:  # floors are looked up before anything is written
            set_floors(self.settings.validation)
        except ValueError as error:
            raise ValueError(f"validation of team is not a set of floors: {error}") from error
        self._try_worlds()
        begin_folder(self.folder / TRAINING_FILE, self.settings.as_dict(), FloorChoice(self.settings.floors).in_files())
        with only_writer(self.folder / TRAINING_FILE):
            checkpoints = self.folder / CHECKPOINTS
            for folder, suffix in itertools.product((self.folder, checkpoints), (".json", ".csv")):
                clear_unfinished(folder, suffix)
                remove_unfinished(folder, (".safetensors",))
            torch.set_num_threads(1)
            last, total = latest_checkpoint(checkpoints), self.settings.learning.whole_decisions
            done = 0 if last is None else last.decisions
            if done:
                self._best_weights()  # damaged ones are named before more is learned
            yield Progress("rewards", done, total)
            if last is None or done < total:
                learn = self._learn_values if self.settings.algorithm in VALUES else self._learn_policy
                with closing(learn(last is None)) as found:
                    for checkpoint in found:
                        self._write(checkpoint)
                        coverage = checkpoint.curve[-1][1] or 0.0
                        yield Progress("rewards", checkpoint.decisions, total, {"coverage": coverage})
            self._write(latest_checkpoint(checkpoints))
        yield Progress("best weights", 1, 1)

    def _try_worlds(self) -> None:
        """Begin an episode of each world: some settings are first refused by an environment."""
        settings = self.settings
        for floor, realism in ((settings.floors, settings.realism), (set_floors(settings.validation)[0], "ideal")):
            with closing(self._led(vector_env(1, floor, **self._options(realism)))) as environment:
                environment.reset(seed=0)

    def _learn_policy(self, is_new: bool) -> Generator[Checkpoint, None, None]:
        """Learn by PPO or MAPPO."""
        settings, ppo = self.settings, self.settings.ppo
        rows: VecEnv = self._led(sb3_vec_env(*self._floors(ppo), **self._options(settings.realism)))
        if settings.algorithm == "mappo":
            rows = CentralState(rows)
        with closing(VecMonitor(rows)) as environment:
            model = model_of(POLICIES[settings.level], ppo, environment, settings.seed)
            assert isinstance(model.policy, FrontierPolicy)
            network = model.policy.network

            def measure(model: MaskablePPO, before: Checkpoint) -> float:
                reached = self._measured(network, before)
                model.logger.record("validation/coverage", reached)
                model.logger.dump(model.num_timesteps)
                return reached

            def begin_at(number: int) -> None:
                environment.seed(_episodes_seed(settings.seed, number))

            yield from learn_on(
                model,
                ppo,
                settings.seed,
                self.folder / CHECKPOINTS,
                self.folder / TENSORBOARD,
                begin_at,
                measure,
                self._first(network, is_new),
            )

    def _learn_values(self, is_new: bool) -> Generator[Checkpoint, None, None]:
        """Learn by QMIX or VDN."""
        from lidarium.training.teams.value_decomposition import learn_values

        settings, value = self.settings, self.settings.value
        with closing(vector_env(*self._floors(value), **self._options(settings.realism))) as environment:
            torch.manual_seed(settings.seed)
            network = POLICIES[settings.level].ranking(environment.single_observation_space)
            yield from learn_values(
                settings,
                environment,
                network,
                self.folder / CHECKPOINTS,
                self.folder / TENSORBOARD,
                partial(_episodes_seed, settings.seed),
                partial(self._measured, network),
                self._first(network, is_new),
            )

    @property
    def _is_led(self) -> bool:
        return self.settings.supervisor is not None

    def _led(self, environment: Any) -> Any:  # noqa: ANN401
        """Return a batch, under a supervisor if the team has one."""
        led = self.settings.supervisor
        return environment if led is None else Supervised(environment, masks_orders=True, **led)

    def _options(self, realism: str) -> dict[str, Any]:
        """Return the options of environments."""
        own = {"level": self.settings.level, "threads": 1, "reports": self._is_led}
        return own | self.settings.options(realism)

    def _floors(self, learning: PpoSettings | ValueSettings) -> tuple[int, str]:
        """Return the number of parallel episodes, and their floors."""
        return learning.environments // self.settings.robots, self.settings.floors

    def _first(self, network: OptionRanking, is_new: bool) -> Checkpoint:
        """Return the curve before a network learns."""
        return Checkpoint(0, [(0, self._validated(network))] if is_new else [])

    def _measured(self, network: OptionRanking, before: Checkpoint) -> float:
        """Return the coverage that the network reaches; keep its weights if it is the best so far."""
        reached = self._validated(network)
        if reached > max((found for number, found in before.curve if number and found is not None), default=-1.0):
            zoo_files("", self.settings.level).save(self.folder / WEIGHTS_FILE, network.weights())
        return reached

    def _validated(self, network: OptionRanking) -> float:
        """Return the coverage that a network reaches, mean over the time of an episode and over the floors.

        The network takes its preferred actions, from the same starts each time.
        """
        settings, floors = self.settings, set_floors(self.settings.validation)
        batch = vector_env(len(floors), floors[0], copy=False, **self._options("ideal"))
        environment = self._led(batch)
        with closing(environment):
            seen, infos = environment.reset(seed=[0] * len(floors), options={"floor": list(floors)})
            reached, has_ended = infos["truth"]["coverage"].copy(), np.zeros((len(floors), settings.robots), np.bool_)
            decisions, total = math.ceil(settings.horizon_s / batch.engine.level.period_s), 0.0
            for _ in range(decisions):
                seen, _, terminated, truncated, infos = environment.step(network.preferred(seen))
                lasts = ~np.repeat(has_ended.all(axis=1), settings.robots)  # its robots may end one by one
                reached[lasts] = infos["truth"]["coverage"][lasts]
                has_ended |= (terminated | truncated).reshape(has_ended.shape)
                total += float(reached.mean())
        return total / decisions

    def _best_weights(self) -> dict[str, NDArray[np.float32]]:
        """Return the weights of the best network so far."""
        path, cure = self.folder / WEIGHTS_FILE, "put a copy back, or choose another folder"
        if not path.is_file():
            raise FileNotFoundError(f"{path}, the best weights so far, is missing; {cure}")
        try:
            return zoo_files("", self.settings.level).load(path)
        except ValueError as error:
            raise ValueError(f"{error}; {cure}") from error

    def _write(self, checkpoint: Checkpoint | None) -> None:
        """Write the curve and the card of the best network so far."""
        assert checkpoint is not None  # the curve has one point at least
        curve = [(number, found) for number, found in checkpoint.curve if found is not None]
        write_text(self.folder / CURVE_FILE, "step,coverage\n" + "".join(f"{k},{found}\n" for k, found in curve))
        best = max(curve[1:] or curve, key=lambda entry: entry[1])
        digest = zoo_files("", self.settings.level).save(self.folder / WEIGHTS_FILE, self._best_weights())
        card: dict[str, Any] = {
            "sha256": digest,
            "decisions": checkpoint.decisions,
            "best": {"decisions": best[0], "coverage": best[1]},
            "untrained": {"coverage": curve[0][1]},
            "curve": curve,
            "versions": versions(LIBRARIES),
            "training": asked_for(self.settings.as_dict()),
        }
        write_json(self.folder / CARD_FILE, card)


def _episodes_seed(seed: int, number: int) -> int:
    """Return the seed of the episodes behind a checkpoint: they draw floors and starts of their own."""
    draws = np.random.SeedSequence([LEARNING_WORLD_SEED, seed, number])
    return int(draws.generate_state(1)[0]) >> 1
