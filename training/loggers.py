"""Curves of a training in Weights & Biases or MLflow, beside its folder and TensorBoard."""

import json
import os
from abc import ABC, abstractmethod
from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from typing import Any

from lidarium.extras import install_command
from lidarium.mapping.files.guarded_reading import read_text, reading
from lidarium.mapping.files.output import write_json
from lidarium.training.progress import Progress

RUNS_FILE = "logged_runs.json"
"""File in the folder of a training with the run of each logger, which a training that goes on continues."""

PROJECT = "lidarium"
_MOST_BYTES = 1 << 16


class Logger(ABC):
    """Takes the figures of a training.

    Parameters
    ----------
    folder : Path
        Folder of the training.
    settings : mapping
        Settings of the training by dotted names.
    """

    name: str

    def __init__(self, folder: Path, settings: Mapping[str, Any]) -> None:
        runs = _runs_of(folder)
        run = self.begin(folder, settings, runs.get(self.name))
        write_json(folder / RUNS_FILE, {**runs, self.name: run})

    @abstractmethod
    def begin(self, folder: Path, settings: Mapping[str, Any], run: str | None) -> str:
        """Begin a run, or continue one; return its name."""

    @abstractmethod
    def log(self, step: Progress) -> None:
        """Take the figures of a step."""

    @abstractmethod
    def close(self, is_whole: bool) -> None:
        """End the run: whole, or to go on another time."""


class WandbLogger(Logger):
    """Weights & Biases; ``WANDB_MODE=offline`` keeps everything in the folder."""

    name = "wandb"

    def begin(self, folder: Path, settings: Mapping[str, Any], run: str | None) -> str:
        """Begin a run, or continue one."""
        import wandb

        project = os.environ.get("WANDB_PROJECT", PROJECT)
        self._run = wandb.init(
            project=project, name=folder.name, id=run, resume="allow", dir=str(folder), config=dict(settings)
        )
        self._parts: set[str] = set()
        return str(self._run.id)

    def log(self, step: Progress) -> None:
        """Take the figures of a step, over how far its part has come."""
        if step.part not in self._parts:
            self._parts.add(step.part)
            self._run.define_metric(f"{step.part}/*", step_metric=f"{step.part}/done")
        figures = {f"{step.part}/{name}": float(figure) for name, figure in step.figures.items()}
        self._run.log({f"{step.part}/done": step.done, **figures})

    def close(self, is_whole: bool) -> None:
        """End the run."""
        self._run.finish(exit_code=0 if is_whole else 1)


class MlflowLogger(Logger):
    """MLflow; without ``MLFLOW_TRACKING_URI`` everything stays in the folder."""

    name = "mlflow"

    def begin(self, folder: Path, settings: Mapping[str, Any], run: str | None) -> str:
        """Begin a run, or continue one."""
        from mlflow.tracking import MlflowClient

        uri = os.environ.get("MLFLOW_TRACKING_URI") or f"sqlite:///{(folder / 'mlflow.db').resolve()}"
        self._client = MlflowClient(uri)
        if run is None:
            found = self._client.get_experiment_by_name(PROJECT)
            experiment = self._client.create_experiment(PROJECT) if found is None else found.experiment_id
            run = str(self._client.create_run(experiment, run_name=folder.name).info.run_id)
            for name, value in settings.items():
                self._client.log_param(run, name, str(value)[:500])
        self._client.update_run(run, status="RUNNING")
        self._id = run
        return run

    def log(self, step: Progress) -> None:
        """Take the figures of a step."""
        for name, figure in step.figures.items():
            self._client.log_metric(self._id, f"{step.part}/{name}", float(figure), step=step.done)

    def close(self, is_whole: bool) -> None:
        """End the run."""
        self._client.set_terminated(self._id, status="FINISHED" if is_whole else "KILLED")


LOGGERS: dict[str, type[Logger]] = {logger.name: logger for logger in (WandbLogger, MlflowLogger)}


def check_logger(name: str) -> None:
    """Check that there is such a logger, and that its package is installed.

    Raises
    ------
    ValueError
        If one of both is not the case.
    """
    if name not in LOGGERS:
        raise ValueError(f"there is no logger {name!r}; want {' or '.join(LOGGERS)}")
    try:
        import_module(name)
    except ImportError as error:
        raise ValueError(f"logging to {name} needs a package: {install_command('loggers')} ({error})") from error


def make_logger(name: str, folder: Path, settings: Mapping[str, Any]) -> Logger:
    """Return a logger by name, in the folder of a training that has begun; see `check_logger`."""
    check_logger(name)
    return LOGGERS[name](folder, settings)


def _runs_of(folder: Path) -> dict[str, str]:
    path = folder / RUNS_FILE
    if not path.exists():
        return {}
    with reading(path, "the runs of loggers", "remove it, and new ones begin"):
        runs = json.loads(read_text(path, _MOST_BYTES))
        if not isinstance(runs, dict) or not all(isinstance(run, str) for run in runs.values()):
            raise ValueError("it is no table of names")
        return runs


def flattened(content: Any, name: str = "") -> dict[str, Any]:  # noqa: ANN401
    """Return the values of tables and lists by dotted names, such as ``rounds.0.floors``."""
    if not isinstance(content, dict | list):
        return {name: content}
    parts = content.items() if isinstance(content, dict) else enumerate(content)
    found: dict[str, Any] = {}
    for key, part in parts:
        found |= flattened(part, f"{name}.{key}" if name else str(key))
    return found
