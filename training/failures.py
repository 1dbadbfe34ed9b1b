"""Errors of episodes, with the episode's name."""

from typing import NoReturn

from lidarium.evaluation.processes import WorkerDiedError


def raise_named(error: Exception, episode: str) -> NoReturn:
    """Raise the error of an episode so that it names the episode."""
    if isinstance(error, ValueError | WorkerDiedError):
        raise ValueError(f"{episode} failed: {error}; what was finished before is kept") from error
    error.add_note(f"{episode} failed; what was finished before is kept")
    raise error
