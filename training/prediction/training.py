"""A whole training of a network that predicts maps, in a folder: floors are explored, a network is fitted.

Finished parts are on the disk. The same call continues an interrupted one.
"""

import json
import time
from collections.abc import Generator, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path

import numpy as np
import torch

from lidarium.envs.floors.catalogue.names import load_floor
from lidarium.evaluation.processes import shared_out
from lidarium.mapping.files.guarded_reading import read_text, reading
from lidarium.mapping.files.output import clear_unfinished, only_writer, remove_unfinished, write_json
from lidarium.mapping.prediction.network import FILES
from lidarium.training.failures import raise_named
from lidarium.training.folder import asked_for, begin_folder, versions
from lidarium.training.prediction.fitting import Fitting, Windows, judged
from lidarium.training.prediction.maps import FloorMaps, explore, read_maps, source_of, write_maps
from lidarium.training.prediction.settings import PredictionSettings
from lidarium.training.progress import Progress

TRAINING_FILE, WEIGHTS_FILE, CARD_FILE = "training.json", "weights.safetensors", "card.json"
MAPS, FIT_FILE, TIME_FILE = "maps", "fit.safetensors", "explored.json"
LIBRARIES = ("numpy", "numba", "torch")
MOST_BYTES = 1 << 20

HELD_OUT_SEED = 9
"""Floors are held out by draws of this seed, whatever is trained."""


@dataclass(frozen=True, slots=True)
class PredictionTraining:
    """A training that runs into a folder."""

    settings: PredictionSettings
    folder: Path
    workers: int = 1
    device: str = "cpu"

    def run(self) -> Generator[Progress, None, None]:
        """Run the missing parts, and yield each step when it is on the disk."""
        if self.workers < 1:
            raise ValueError(f"workers is {self.workers}; want at least 1")
        _check_device(self.device)
        for plan in self.settings.plans:
            load_floor(plan)
        begin_folder(self.folder / TRAINING_FILE, asdict(self.settings))
        with only_writer(self.folder / TRAINING_FILE):
            clear_unfinished(self.folder, ".json")
            remove_unfinished(self.folder, (".safetensors",))
            (self.folder / MAPS).mkdir(exist_ok=True)
            remove_unfinished(self.folder / MAPS, (".npz",))
            yield from self._explore()
            yield from self._fit()
        yield Progress("weights", 1, 1)

    def _file(self, number: int) -> Path:
        return self.folder / MAPS / f"{number:06d}.npz"

    def _explore(self) -> Generator[Progress, None, None]:
        """Explore the missing floors, until they are done or the time is over."""
        total, path = self.settings.floors, self.folder / TIME_FILE
        numbers = [number for number in range(total) if not self._file(number).exists()]
        done, spent = total - len(numbers), 0.0
        if path.exists():
            with reading(path, "how long a training has explored"):
                spent = float(json.loads(read_text(path, MOST_BYTES))["seconds"])
        limit = 60.0 * self.settings.floors_minutes or np.inf
        yield Progress("floors", done, total)
        began = time.monotonic() - spent
        if not numbers or spent >= limit:
            return
        with closing(shared_out(partial(_explored, self.settings, self.folder / MAPS), numbers, self.workers)) as parts:
            for number, result in parts:
                if isinstance(result, Exception):
                    raise_named(result, f"exploring floor {number} of the training")
                done, spent = done + 1, time.monotonic() - began
                write_json(path, {"seconds": spent})
                yield Progress("floors", done, total, {"maps": float(result)})
                if spent >= limit:
                    break

    def _fit(self) -> Generator[Progress, None, None]:
        """Fit the network, and write weights and card."""
        if (self.folder / CARD_FILE).exists():
            return
        paths = sorted((self.folder / MAPS).glob("*.npz"))
        sources = [source_of(self.settings, int(path.stem)) for path in paths]
        if len(set(sources)) < 2:
            raise ValueError(
                f"{self.folder / MAPS} has maps of {len(set(sources))} floors; want 2 at least: one is held out"
            )
        floors = [read_maps(path) for path in paths]
        is_held_out = held_out(sources, self.settings.held_out)
        fitted = [floor for floor, is_out in zip(floors, is_held_out, strict=True) if not is_out]
        others = [floor for floor, is_out in zip(floors, is_held_out, strict=True) if is_out]
        fitting = Fitting(self.settings, self.folder / FIT_FILE, self.device)
        for step in fitting.run(Windows(fitted)):
            yield Progress("fit", step.step, self.settings.steps, {"loss": step.loss, "minutes": step.seconds / 60.0})
        fitting.network.set_weights(fitting.weights())
        quality = judged(fitting.network, others, self.settings.seed)
        digest = FILES.save(self.folder / WEIGHTS_FILE, fitting.weights())
        card = {
            "sha256": digest,
            "versions": versions(LIBRARIES),
            "device": self.device,
            "minutes": fitting.seconds / 60.0,
            "steps": fitting.step,
            "floors": len(fitted),
            "maps": sum(len(floor.levels) for floor in fitted),
            "held_out_floors": len(others),
            "held_out": quality.as_dict(),
            "training": asked_for(asdict(self.settings)),
        }
        write_json(self.folder / CARD_FILE, card)


def _explored(settings: PredictionSettings, folder: Path, number: int) -> int:
    """Explore a floor and write its maps; return how many there are."""
    maps: FloorMaps = explore(settings, number)
    write_maps(folder / f"{number:06d}.npz", maps)
    return len(maps.levels)


def held_out(sources: Sequence[tuple[int, ...]], share: float) -> list[bool]:
    """Return which floors are held out: at least one, not all, and all floors of one source alike."""
    draws = [float(np.random.default_rng([HELD_OUT_SEED, *source]).random()) for source in sources]
    lowest, limit = min(draws), min(share, max(draws))
    return [draw == lowest or draw < limit for draw in draws]


def _check_device(device: str) -> None:
    """Check that a device is there."""
    if device != "cpu" and not (device.startswith("cuda") and torch.cuda.is_available()):
        raise ValueError(f"device {device!r} is not there; want cpu, or cuda if PyTorch finds a GPU")
