"""Lessons as arrays, in files."""

import io
from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.files.guarded_arrays import GuardedArchive
from lidarium.mapping.files.guarded_reading import read_bytes, reading
from lidarium.mapping.files.output import write_whole
from lidarium.training.decisions import MOST_OPTIONS, MOST_TEAMMATES, Decisions, stacked
from lidarium.training.teaching.teacher import Lesson


@dataclass(frozen=True, slots=True)
class Samples:
    """N decisions, and what the teacher says of them.

    Attributes
    ----------
    decisions : Decisions
        What robots saw.
    regrets : (N, MOST_OPTIONS) float32
        By how much each option costs more than the best [m].
    """

    decisions: Decisions
    regrets: NDArray[np.float32]

    def __len__(self) -> int:
        return len(self.regrets)


def samples_of(lessons: Sequence[Lesson]) -> Samples:
    """Return lessons as arrays."""
    regrets = np.zeros((len(lessons), MOST_OPTIONS), np.float32)
    for k, lesson in enumerate(lessons):
        regrets[k, : len(lesson.regrets)] = lesson.regrets
    return Samples(stacked([lesson.decision for lesson in lessons]), regrets)


def joined(parts: Sequence[Samples]) -> Samples:
    """Return the samples of several parts as one.

    Raises
    ------
    ValueError
        Where there is no part.
    """
    if not parts:
        raise ValueError("there are no lessons to learn from; want those of at least one floor")
    decisions = Decisions(
        *(
            np.concatenate([getattr(part.decisions, field.name) for part in parts])
            for field in fields(Decisions)
        )
    )
    return Samples(decisions, np.concatenate([part.regrets for part in parts]))


def write_samples(path: Path, samples: Samples) -> None:
    """Write samples to a file, whole or not at all."""
    arrays = {field.name: getattr(samples.decisions, field.name) for field in fields(Decisions)}
    arrays["regrets"] = samples.regrets
    content = io.BytesIO()
    np.savez_compressed(content, allow_pickle=False, **arrays)
    write_whole(path, content.getvalue())


def read_samples(path: Path) -> Samples:
    """Read what ``write_samples`` has written.

    Raises
    ------
    ValueError
        Where the file holds something else.
    """
    with reading(path, "lessons of a training", "remove it, and the same command teaches there again"):
        archive = GuardedArchive(read_bytes(path))
        decisions = Decisions(*(archive.array(field.name) for field in fields(Decisions)))
        samples = Samples(decisions, archive.array("regrets"))
        _check(samples)
        return samples


def _check(samples: Samples) -> None:
    """Check that all arrays are as ``samples_of`` makes them.

    Raises
    ------
    ValueError
        Where one is not; the message names it.
    """
    wanted = samples_of([])
    own, like_own = samples.decisions, wanted.decisions
    pairs = [
        (field.name, getattr(own, field.name), getattr(like_own, field.name)) for field in fields(Decisions)
    ]
    pairs.append(("regrets", samples.regrets, wanted.regrets))
    for name, array, like in pairs:
        shape = (len(samples), *like.shape[1:])
        if array.shape != shape or array.dtype != like.dtype:
            raise ValueError(f"{name} is {array.dtype} {array.shape}; want {like.dtype} {shape}")
        if not np.isfinite(array).all():
            raise ValueError(f"{name} has numbers that are not finite")
    most = np.array([MOST_OPTIONS, MOST_TEAMMATES])
    if ((samples.decisions.counts < 0) | (samples.decisions.counts > most)).any():
        raise ValueError(f"counts has numbers that are not from 0 to {MOST_OPTIONS} and {MOST_TEAMMATES}")
