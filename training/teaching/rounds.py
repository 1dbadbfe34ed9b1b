"""A round: robots are taught on some floors, and a network is fitted to all lessons so far."""

from collections.abc import Generator
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray

from lidarium.agents.learned.decision import Chooser, choose_classic
from lidarium.agents.learned.network import Network, load_weights, save_weights
from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.evaluation.episodes.runner import run_episode
from lidarium.evaluation.processes import shared_out
from lidarium.evaluation.suites.starts import drawn_starts
from lidarium.mapping.files.output import write_json
from lidarium.training.failures import raise_named
from lidarium.training.places import first_number, place_of
from lidarium.training.progress import Progress
from lidarium.training.settings import FROM_TOURS, SHIPPED, TrainingSettings
from lidarium.training.teaching.fitting import Fit, fit
from lidarium.training.teaching.samples import Samples, read_samples, samples_of, write_samples
from lidarium.training.teaching.teacher import TaughtTours
from lidarium.training.torch_network import ExplorerNetwork

LESSONS, WEIGHTS, FIT, WITHOUT = "lessons", "weights.safetensors", "fit.json", ".none"


@dataclass(frozen=True, slots=True)
class RoundFolder:
    """If a round is kept.

    Attributes
    ----------
    training : Path
        The folder of the training.
    number : int
        Number of the round.
    """

    training: Path
    number: int

    @property
    def path(self) -> Path:
        """The round's own folder."""
        return self.training / f"round-{self.number}"

    @property
    def weights(self) -> Path:
        """The fitted network."""
        return self.path / WEIGHTS

    def before(self, begin: str) -> dict[str, NDArray[np.float32]] | None:
        """Return the weights that decide in it, None if tours do; a training may ``begin`` with weights."""
        if self.number:
            return load_weights(RoundFolder(self.training, self.number - 1).weights)
        return None if begin == FROM_TOURS else load_weights("" if begin == SHIPPED else begin)

    def lessons(self, number: int) -> Path:
        """Return the file of the lessons of an episode."""
        return self.path / LESSONS / f"{number:06d}.npz"


def run_round(training: TrainingSettings, folder: RoundFolder, workers: int) -> Generator[Progress, None, None]:
    """Do the missing parts of a round, floor by floor; finished parts are on the disk."""
    if folder.weights.exists():
        return
    stage = training.rounds[folder.number]
    begin = first_number(training, folder.number)
    numbers = range(begin, begin + stage.floors)
    missing = [number for number in numbers if not _is_done(folder.lessons(number))]
    name = f"round {folder.number}: lessons"
    done = stage.floors - len(missing)
    folder.lessons(0).parent.mkdir(parents=True, exist_ok=True)
    yield Progress(name, done, stage.floors)
    for number, result in shared_out(partial(_teach, training, folder), missing, workers):
        if isinstance(result, Exception):
            place = place_of(training, stage, number)
            raise_named(result, f"teaching on {place.name} with {place.settings.robots} robots")
        done += 1
        yield Progress(name, done, stage.floors, {"floor": float(number), "samples": float(result)})
    yield from _fit(training, folder)


def _is_done(path: Path) -> bool:
    return path.exists() or path.with_suffix(WITHOUT).exists()


def _teach(training: TrainingSettings, folder: RoundFolder, number: int) -> int:
    """Teach robots on a floor and write their lessons; return how many there are."""
    before = folder.before(training.begin)
    choose: Chooser = choose_classic if before is None else Network(before)
    stage = training.rounds[folder.number]
    place = place_of(training, stage, number)
    env = ExplorationEnv(place.floor, place.settings)
    policy = TaughtTours(env, choose, stage.teaching_share, place.seed, place.predictor)
    starts = drawn_starts(place.floor, place.settings, place.seed)
    run_episode(policy, env, place.seed, None if starts is None else {"starts": starts})
    path = folder.lessons(number)
    if not policy.lessons:
        path.with_suffix(WITHOUT).touch()
        return 0
    write_samples(path, samples_of(policy.lessons))
    return len(policy.lessons)


def _fit(training: TrainingSettings, folder: RoundFolder) -> Generator[Progress, None, None]:
    """Fit a network to the lessons of this round and all before it."""
    torch.manual_seed(training.seed + folder.number)
    network = ExplorerNetwork()
    before = folder.before(training.begin)
    if before is not None:
        network.set_weights(before)
    floors: list[Samples] = []
    for number in range(folder.number + 1):
        part = RoundFolder(folder.training, number).path / LESSONS
        floors += [read_samples(path) for path in sorted(part.glob("*.npz"))]
    course: list[Fit] = []
    name = f"round {folder.number}: fit"
    for each in fit(network, floors, training.fit, training.seed + folder.number):
        course.append(each)
        yield Progress(name, len(course), training.fit.epochs, asdict(each))
    samples = sum(len(each) for each in floors)
    write_json(folder.path / FIT, {"floors": len(floors), "samples": samples, "epochs": [asdict(e) for e in course]})
    # Last: where it is, the round has ended.
    save_weights(folder.weights, network.weights(), training.predictor)
