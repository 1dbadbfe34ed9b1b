"""`lidarium train`: train explorers by a teacher and by rewards, into a folder."""

import json
import os
import shlex
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from tyro.conf import Positional

from lidarium.extras import check_installed
from lidarium.scripts.common import INTERRUPTED, LINE_PERIOD_S, Answer, Command, compile_first, notify, table

if TYPE_CHECKING:
    from lidarium.training.loggers import Logger
    from lidarium.training.prediction.settings import PredictionSettings
    from lidarium.training.prediction.training import PredictionTraining
    from lidarium.training.progress import Progress
    from lidarium.training.settings import TeamSettings, TrainingSettings
    from lidarium.training.teams.training import TeamTraining
    from lidarium.training.training import Training

    AnySettings = TrainingSettings | PredictionSettings | TeamSettings

DEFAULT_FOLDER = Path("runs/training")

EXTRA = ("torch", "stable_baselines3", "sb3_contrib", "tensorboard")
"""Packages of the extra ``rl``."""


@dataclass(frozen=True, kw_only=True)
class _Train(Command):
    """Train explorers, teams of the zoo, or a network that predicts maps, by the settings of a TOML file.

    A teacher that knows the floors rates each choice, a network is fitted to that, and goes on by rewards if
    the file says so. If the file has a table [team], a team learns by rewards alone. If it has a table [prediction],
    robots explore floors, and a network learns what their partial maps hide. Finished parts are kept, and the same
    command continues after the last one. The best weights and a card with all that made them are
    written to --out, runs/training by default.
    """

    compiles: ClassVar[bool] = True

    config: Positional[Path | None] = None
    """TOML file of the training, with its seed, such as `lidarium examples copy` gives; or a name of --list"""
    list: bool = False
    """list the trainings that ship, and end"""
    workers: int = 0
    """processes; 0 for as many as there are cores"""
    device: str = "cpu"
    """where a network that predicts maps is fitted: cpu or cuda"""
    log: tuple[str, ...] = ()
    """where curves are logged as well: wandb or mlflow (extra loggers); a training that goes on continues its run"""


def execute(command: _Train) -> Answer:
    """Do the missing parts of a training."""
    from lidarium.mapping.files.output import check_writable

    if command.list:
        return _listed()
    if command.config is None:
        raise ValueError("no training is named; want a TOML file, or a name of `lidarium train --list`")
    if command.workers < 0:
        raise ValueError(f"--workers is {command.workers}; want 0 for as many as there are cores, or more")
    from lidarium.training.loggers import check_logger
    from lidarium.training.prediction.settings import PredictionSettings
    from lidarium.training.settings import TeamSettings, read_any_training

    settings = read_any_training(_file_of(command.config))
    if "seed" in command.given:
        settings = replace(settings, seed=command.seed)
    is_prediction, is_team = isinstance(settings, PredictionSettings), isinstance(settings, TeamSettings)
    check_installed("training", EXTRA[:1] if is_prediction else EXTRA, "rl")
    if isinstance(settings, TeamSettings) and settings.table == "value":
        check_installed("training", ("torchrl",), "torchrl")
    if command.device != "cpu" and not is_prediction:
        raise ValueError(f"--device is {command.device}, and explorers are trained on the cpu; leave it out")
    folder = command.out or DEFAULT_FOLDER
    check_writable(folder)
    for name in command.log:
        check_logger(name)
    compile_first()
    training = _training_of(settings, folder, command.workers or len(os.sched_getaffinity(0)), command.device)
    steps, show, is_interrupted, is_whole = training.run(), _Shown(command.json), False, False
    loggers: list[Logger] = []
    try:
        for step in steps:
            # A training refuses a folder with files of others, so that loggers write theirs after its first step.
            loggers = loggers or _loggers(command.log, folder, settings)
            show(step)
            for logger in loggers:
                logger.log(step)
        is_whole = True
    except KeyboardInterrupt:
        is_interrupted = True
    finally:
        steps.close()
        show.close()
        for logger in loggers:
            logger.close(is_whole)
    answer = _predictor_answer if is_prediction else _team_answer if is_team else _answer
    return answer(folder, is_interrupted)


def _shipped() -> "dict[str, Path]":
    """Return the files of the trainings that ship, by name."""
    folder = Path(str(resources.files("lidarium.training.teams") / "data"))
    return {path.stem: path for path in sorted(folder.glob("*.toml"))}


def _file_of(config: Path) -> Path:
    """Return the file of a training: one that is there, or one that ships."""
    return config if config.is_file() else _shipped().get(str(config), config)


def _listed() -> Answer:
    """Return the trainings that ship."""
    from lidarium.training.settings import TeamSettings, read_any_training

    found = {name: read_any_training(path) for name, path in _shipped().items()}
    teams = {name: each for name, each in found.items() if isinstance(each, TeamSettings)}
    header = ("training", "algorithm", "level", "robots", "decisions", "floors")
    rows = [
        (name, each.algorithm, each.level, each.robots, f"{each.learning.whole_decisions:,}", each.floors)
        for name, each in teams.items()
    ]
    return Answer({"trainings": {name: each.as_dict() for name, each in teams.items()}}, table(rows, header))


def _loggers(names: Sequence[str], folder: Path, settings: "AnySettings") -> "list[Logger]":
    """Return the loggers of a training, each once."""
    from lidarium.training.loggers import flattened, make_logger

    return [make_logger(name, folder, flattened(asdict(settings))) for name in dict.fromkeys(names)]


def _training_of(
    settings: "AnySettings", folder: Path, workers: int, device: str
) -> "Training | PredictionTraining | TeamTraining":
    """Return what a file asks for: the training of explorers, of a team, or of a network that predicts maps."""
    from lidarium.training.settings import TeamSettings, TrainingSettings

    if isinstance(settings, TeamSettings):
        from lidarium.training.teams.training import TeamTraining

        return TeamTraining(settings, folder)
    if isinstance(settings, TrainingSettings):
        from lidarium.training.training import Training

        return Training(settings, folder, workers)
    from lidarium.training.prediction.training import PredictionTraining

    return PredictionTraining(settings, folder, workers, device)


class _Shown:
    """Shows how far a training has come.

    A bar for each part on a terminal, otherwise lines: the first and last of a part, and one every few seconds.
    """

    def __init__(self, is_quiet: bool, clock: Callable[[], float] = time.monotonic) -> None:
        self._has_bar, self._clock = not is_quiet and sys.stderr.isatty(), clock
        self._bar: Any = None
        self._part, self._first, self._began, self._shown_at = "", 0, 0.0, 0.0

    def __call__(self, step: "Progress") -> None:
        """Show a step."""
        is_new, now = step.part != self._part, self._clock()
        if is_new:
            self._part, self._first, self._began = step.part, step.done, now
        if self._has_bar:
            self._draw(step, is_new)
        elif is_new or step.done == step.total or now - self._shown_at >= LINE_PERIOD_S:
            self._shown_at = now
            notify(f"{step.part}: {step.done:,} of {step.total:,}{self._left(step, now)}{_figures(step)}")

    def _draw(self, step: "Progress", is_new: bool) -> None:
        from tqdm import tqdm

        if is_new:
            self.close()
            self._bar = tqdm(desc=step.part, total=step.total, initial=step.done, file=sys.stderr, dynamic_ncols=True)
        self._bar.update(step.done - self._bar.n)
        self._bar.set_postfix_str(_figures(step).strip(" ()"))

    def _left(self, step: "Progress", now: float) -> str:
        """Return how long the part still takes, if that can be said."""
        if step.done in (self._first, step.total):
            return ""
        return f", {_span((now - self._began) * (step.total - step.done) / (step.done - self._first))} left"

    def close(self) -> None:
        """End the bar of the part that runs."""
        if self._bar is not None:
            self._bar.close()


def _figures(step: "Progress") -> str:
    figures = ", ".join(f"{name} {value:.4g}" for name, value in step.figures.items())
    return f" ({figures})" if figures else ""


def _span(seconds: float) -> str:
    """Return a time in words."""
    if seconds < 90.0:
        return f"{seconds:.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 5400.0 else f"{seconds / 3600.0:.1f} h"


def _team_answer(folder: Path, is_interrupted: bool) -> Answer:
    from lidarium.agents.zoo.network import OBSERVED
    from lidarium.mapping.files.guarded_reading import read_text
    from lidarium.training.folder import MOST_BYTES
    from lidarium.training.teams.training import CARD_FILE, WEIGHTS_FILE

    if is_interrupted or not (folder / CARD_FILE).exists():
        text = f"interrupted; what is finished is in {folder}, and the same command goes on there"
        return Answer({"folder": str(folder), "interrupted": True}, text, INTERRUPTED)
    card = json.loads(read_text(folder / CARD_FILE, MOST_BYTES))
    best, untrained = card["best"], card["untrained"]["coverage"]
    lines = [
        f"best after {best['decisions']:,} of {card['decisions']:,} decisions, in {folder / WEIGHTS_FILE}",
        f"coverage on the validation floors, mean over an episode: {100 * best['coverage']:.1f} %, "
        f"{100 * untrained:.1f} % before it learned",
    ]
    if best["coverage"] <= untrained:
        lines.append("it is no better than before it learned; want more decisions or floors")
    asked = card["training"]
    name = "zoo:tours-2" if asked["level"] == "tour" else "zoo:ppo-2"
    if asked["supervisor"] is None:
        weights = shlex.quote(f"weights={folder / WEIGHTS_FILE}")
        lines.append(f"use them: lidarium run --policy {name} --policy-set {weights}")
    else:  # no policy of the command line puts a team of the zoo under a supervisor
        given = "".join(f", {key}={value!r}" for key, value in asked["supervisor"].items())
        lines += [
            "use them in Python, under their supervisor and from unknown starts:",
            f"policy = lidarium.Supervised(lidarium.policy({name!r}, weights={str(folder / WEIGHTS_FILE)!r}){given})",
            f"env = lidarium.parallel_env(robots={asked['robots']}, known_starts=False, level={asked['level']!r}, "
            f"observe={[*OBSERVED[asked['level']][1:]]})",
            "lidarium.run_episode(policy, env, seed=0)",
        ]
    return Answer({"folder": str(folder), "interrupted": False, **card}, "\n".join(lines))


def _predictor_answer(folder: Path, is_interrupted: bool) -> Answer:
    from lidarium.mapping.files.guarded_reading import read_text
    from lidarium.training.prediction.training import CARD_FILE, MOST_BYTES, WEIGHTS_FILE

    if is_interrupted or not (folder / CARD_FILE).exists():
        text = f"interrupted; what is finished is in {folder}, and the same command goes on there"
        return Answer({"folder": str(folder), "interrupted": True}, text, INTERRUPTED)
    card = json.loads(read_text(folder / CARD_FILE, MOST_BYTES))
    found = card["held_out"]
    lines = [
        f"weights of {card['steps']:,} steps on {card['maps']:,} maps of {card['floors']:,} floors in "
        f"{folder / WEIGHTS_FILE}",
        f"on {card['held_out_floors']:,} other floors {100 * found['wrong']:.1f} % of the unknown squares near known "
        f"ones are wrong; {100 * found['wrong_all_free']:.1f} % if all were free, "
        f"{100 * found['wrong_nearest']:.1f} % if each were as the nearest known one; calibration error "
        f"{found['calibration']:.3f}",
    ]
    if found["wrong"] >= min(found["wrong_all_free"], found["wrong_nearest"]):
        lines.append("it is no better than a guess without a network; want more floors or steps")
    weights = shlex.quote(f"weights={folder / WEIGHTS_FILE}")
    lines.append(f"use them: lidarium run --policy predicted_tours --policy-set {weights}")
    return Answer({"folder": str(folder), "interrupted": False, **card}, "\n".join(lines))


def _answer(folder: Path, is_interrupted: bool) -> Answer:
    from lidarium.mapping.files.guarded_reading import read_text
    from lidarium.training.settings import MOST_BYTES
    from lidarium.training.training import CARD_FILE, WEIGHTS_FILE

    if is_interrupted or not (folder / CARD_FILE).exists():
        text = f"interrupted; what is finished is in {folder}, and the same command goes on there"
        return Answer({"folder": str(folder), "interrupted": True}, text, INTERRUPTED)
    card = json.loads(read_text(folder / CARD_FILE, MOST_BYTES))
    rows = [
        (name, f"{found['ratio']:.3f}", f"{100 * found['better']:.0f} %", found["ended"], found["episodes"])
        for name, found in card["validation"].items()
    ]
    header = ("weights", "time over tour_frontier", "faster", "seen enough", "episodes")
    lines = [f"best: {card['best']}, in {folder / WEIGHTS_FILE}", table(rows, header)]
    if card["validation"][card["best"]]["ratio"] >= 1.0:
        lines.append("none is faster than tour_frontier on these floors; want more floors or rounds")
    weights = shlex.quote(f"weights={folder / WEIGHTS_FILE}")
    lines.append(f"use them: lidarium run --policy learned --policy-set {weights}")
    text = "\n".join(lines)
    return Answer({"folder": str(folder), "interrupted": False, **card}, text)
