"""`lidarium train`: trains explorers by a teacher and by rewards, into a folder."""

import importlib.util
import os
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tyro.conf import Positional

from lidarium.scripts.common import INTERRUPTED, LINE_PERIOD_S, Answer, Command, notify, table
from lidarium.scripts.process import first_start

if TYPE_CHECKING:
    from lidarium.training.progress import Progress

DEFAULT_FOLDER = Path("runs/training")

EXTRA = ("torch", "stable_baselines3", "sb3_contrib", "tensorboard")
"""What the extra ``rl`` brings."""


@dataclass(frozen=True, kw_only=True)
class Train(Command):
    """Train explorers as a TOML file says.

    A teacher that knows the floors says what each choice costs, a network is fitted to that, and goes on by
    rewards. Finished parts are kept, and the same command goes on where it stopped. Weights and a card
    that says where they come from are written to the folder.
    """

    config: Positional[Path]
    """TOML file that says what to train; docs/tutorials/train.md shows one"""
    workers: int = 0
    """processes; 0 for as many as there are cores"""


def execute(command: Train) -> Answer:
    """Do what is missing of a training.

    Raises
    ------
    ValueError, FileNotFoundError, OSError
        Where the file or ``--out`` is no good, or the extra is missing; what was finished before is kept.
    """
    from lidarium.evaluation.episodes.output import check_writable

    if command.workers < 0:
        raise ValueError(f"--workers is {command.workers}; want 0 for as many as there are cores, or more")
    _check_extra()
    from lidarium.training.settings import read_training
    from lidarium.training.training import Training

    settings = read_training(command.config)
    folder = command.out or DEFAULT_FOLDER
    check_writable(folder)
    first_start.compile_first(command.json)
    training = Training(settings, folder, command.workers or len(os.sched_getaffinity(0)))
    steps, show, is_interrupted = training.run(), _Shown(command.json), False
    try:
        for step in steps:
            show(step)
    except KeyboardInterrupt:
        is_interrupted = True
    finally:
        steps.close()
        show.close()
    return _answer(folder, is_interrupted)


def _check_extra() -> None:
    """Check that what trains is installed.

    Raises
    ------
    ValueError
        Where it is not; the message names it.
    """
    missing = [name for name in EXTRA if importlib.util.find_spec(name) is None]
    if missing:
        raise ValueError(
            f"training needs {', '.join(missing)}; install the extra: "
            'pip install -c constraints.txt "lidarium[rl]"'
        )


class _Shown:
    """Shows how far a training has come: a bar for each part on a terminal, else lines."""

    def __init__(self, is_quiet: bool) -> None:
        self._has_bar = not is_quiet and sys.stderr.isatty()
        self._bar: Any = None
        self._part, self._shown_at = "", 0.0

    def __call__(self, step: "Progress") -> None:
        """Show a step."""
        figures = ", ".join(f"{name} {value:.4g}" for name, value in step.figures.items())
        if self._has_bar:
            from tqdm import tqdm

            if step.part != self._part:
                self.close()
                self._bar = tqdm(
                    desc=step.part, total=step.total, initial=step.done, file=sys.stderr, dynamic_ncols=True
                )
            self._bar.update(step.done - self._bar.n)
            self._bar.set_postfix_str(figures)
        elif step.part != self._part or time.monotonic() - self._shown_at >= LINE_PERIOD_S:
            notify(f"{step.part}: {step.done} of {step.total}" + (f" ({figures})" if figures else ""))
            self._shown_at = time.monotonic()
        self._part = step.part

    def close(self) -> None:
        """End the bar at hand."""
        if self._bar is not None:
            self._bar.close()


def _answer(folder: Path, is_interrupted: bool) -> Answer:
    import json

    from lidarium.mapping.files.guarded_reading import read_text
    from lidarium.training.settings import MOST_BYTES
    from lidarium.training.training import CARD_FILE, WEIGHTS_FILE

    if is_interrupted or not (folder / CARD_FILE).exists():
        text = f"interrupted; the same command goes on in {folder}"
        return Answer({"folder": str(folder), "interrupted": True}, text, INTERRUPTED)
    card = json.loads(read_text(folder / CARD_FILE, MOST_BYTES))
    rows = [
        (name, f"{found['ratio']:.3f}", f"{100 * found['better']:.0f} %", found["ended"], found["episodes"])
        for name, found in card["validation"].items()
    ]
    header = ("weights", "time over tour_frontier", "faster", "seen enough", "episodes")
    text = "\n".join(
        [
            f"best: {card['best']}, in {folder / WEIGHTS_FILE}",
            table(rows, header),
            f"use them: lidarium run --policy learned --policy-set weights={folder / WEIGHTS_FILE}",
        ]
    )
    return Answer({"folder": str(folder), "interrupted": False, **card}, text)
