"""Lessons as arrays, in files."""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.files.guarded_reading import GuardedArchive, read_bytes, reading
from lidarium.mapping.files.output import write_arrays
from lidarium.training.decisions import MOST_OPTIONS, MOST_TEAMMATES, PER_OPTION, Decisions, stacked
from lidarium.training.teaching.teacher import Lesson


@dataclass(frozen=True, slots=True)
class Samples:
    """N decisions with the teacher's ratings.

    Attributes
    ----------
    decisions : Decisions
        Observations of the robots.
    regrets : (N, n) float32
        By how much each of up to n options costs more than the best [m].
    """

    decisions: Decisions
    regrets: NDArray[np.float32]

    def __len__(self) -> int:
        return len(self.regrets)

    def take(self, rows: NDArray[np.int64]) -> "Samples":
        """Return the samples of some rows."""
        return Samples(self.decisions.take(rows), self.regrets[rows])

    def narrowed(self, width: int) -> "Samples":
        """Return the same samples, none of which has more than that many options, in less memory."""
        return Samples(self.decisions.narrowed(width), np.ascontiguousarray(self.regrets[:, :width]))


def samples_of(lessons: Sequence[Lesson]) -> Samples:
    """Return lessons as arrays."""
    regrets = np.zeros((len(lessons), MOST_OPTIONS), np.float32)
    for k, lesson in enumerate(lessons):
        regrets[k, : len(lesson.regrets)] = lesson.regrets
    return Samples(stacked([lesson.decision for lesson in lessons]), regrets)


def joined(parts: Sequence[Samples]) -> Samples:
    """Return the samples of several parts as one."""
    if not parts:
        raise ValueError("there are no lessons to learn from; want those of at least one floor")
    decisions = Decisions(
        *(np.concatenate([getattr(part.decisions, field.name) for part in parts]) for field in fields(Decisions))
    )
    return Samples(decisions, np.concatenate([part.regrets for part in parts]))


def by_width(parts: Sequence[Samples], widths: Sequence[int]) -> list[Samples]:
    """Return the samples of several parts, those of about as many options together.

    Most decisions have few options, and memory and time go by the most of those that lie together.
    """
    groups = []
    for low, high in zip((-1, *widths[:-1]), widths, strict=True):
        found = []
        for part in parts:
            counts = part.decisions.counts[:, 0]
            rows = np.flatnonzero((counts > low) & (counts <= high))
            if len(rows):
                found.append(_widened(part.take(rows), high))
        if found:
            groups.append(joined(found))
    return groups


def _widened(samples: Samples, width: int) -> Samples:
    """Return the same samples with room for exactly that many options."""
    room = width - samples.regrets.shape[1]
    if room <= 0:
        return samples.narrowed(width)
    decisions = samples.decisions
    parts = {name: _with_room(getattr(decisions, name), room) for name in PER_OPTION}
    return Samples(replace(decisions, **parts), _with_room(samples.regrets, room))


def _with_room(array: NDArray[Any], room: int) -> NDArray[Any]:
    return np.pad(array, [(0, 0), (0, room), *[(0, 0)] * (array.ndim - 2)])


def write_samples(path: Path, samples: Samples) -> None:
    """Write samples to a file, whole or not at all."""
    arrays = {field.name: getattr(samples.decisions, field.name) for field in fields(Decisions)}
    arrays["regrets"] = samples.regrets
    write_arrays(path, arrays)


def read_samples(path: Path) -> Samples:
    """Read the file of ``write_samples``, with room for as many options as there are."""
    with reading(path, "lessons of a training", "remove it, and the same command teaches there again"):
        archive = GuardedArchive(read_bytes(path))
        decisions = Decisions(*(archive.array(field.name) for field in fields(Decisions)))
        samples = Samples(decisions, archive.array("regrets"))
        _check(samples)
        return samples.narrowed(int(samples.decisions.counts[:, 0].max(initial=1)))


def _check(samples: Samples) -> None:
    """Check that all arrays are as ``samples_of`` makes them."""
    wanted = samples_of([])
    own, like_own = samples.decisions, wanted.decisions
    pairs = [(field.name, getattr(own, field.name), getattr(like_own, field.name)) for field in fields(Decisions)]
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
