"""Samples of replays: a decision, what was chosen, another option, and how long either episode took."""

import io
from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.files.guarded_arrays import GuardedArchive
from lidarium.mapping.files.guarded_reading import read_bytes, reading
from lidarium.mapping.files.output import write_whole
from lidarium.training.decisions import Decisions

SHARES = (0.8, 0.9, 0.95, 0.99)
"""Times are those at which these shares of a floor are seen."""


@dataclass(frozen=True, slots=True)
class Samples:
    """N decisions, each replayed with another option.

    Attributes
    ----------
    decisions : Decisions
        What robots saw.
    chosen, other : (N,) int64
        The option that was chosen, and that of the replay.
    times : (N, len(SHARES)) float64
        When the episode had seen each share [s].
    replayed : (N, len(SHARES)) float64
        When the replay had; inf where it had not by the time it was given up [s].
    """

    decisions: Decisions
    chosen: NDArray[np.int64]
    other: NDArray[np.int64]
    times: NDArray[np.float64]
    replayed: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.chosen)


def joined(parts: Sequence[Samples]) -> Samples:
    """Return the samples of several parts as one.

    Raises
    ------
    ValueError
        Where there is no part.
    """
    if not parts:
        raise ValueError("there are no samples to train on; want replays of at least one floor")
    decisions = Decisions(
        *(
            np.concatenate([getattr(part.decisions, field.name) for part in parts])
            for field in fields(Decisions)
        )
    )
    return Samples(
        decisions,
        np.concatenate([part.chosen for part in parts]),
        np.concatenate([part.other for part in parts]),
        np.concatenate([part.times for part in parts]),
        np.concatenate([part.replayed for part in parts]),
    )


def write_samples(path: Path, samples: Samples) -> None:
    """Write samples to a file, whole or not at all."""
    arrays = {field.name: getattr(samples.decisions, field.name) for field in fields(Decisions)}
    for name in ("chosen", "other", "times", "replayed"):
        arrays[name] = getattr(samples, name)
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
    with reading(path, "samples of replays"):
        archive = GuardedArchive(read_bytes(path))
        decisions = Decisions(*(archive.array(field.name) for field in fields(Decisions)))
        return Samples(decisions, *(archive.array(name) for name in ("chosen", "other", "times", "replayed")))
