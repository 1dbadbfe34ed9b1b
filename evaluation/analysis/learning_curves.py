"""Learning curves of trainings: read from CSV, JSON lines and TensorBoard, and joined over seeds."""

import csv
import difflib
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.evaluation.statistics import FEWEST_FOR_BANDS, mean_bands
from lidarium.extras import install_command
from lidarium.mapping.files.guarded_reading import read_text

POINTS = 200
"""Points of joined curves."""

EARLY = 0.9
"""A training ends early that has less than this share of the longest one."""

STEP, VALUE = "step", "value"
"""Names of the columns of TensorBoard's scalars, and of CSV files without a header."""

Values = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class LearningCurve:
    """Trainings of one kind, such as the seeds of an algorithm.

    Attributes
    ----------
    name : str
        Name of the kind.
    x : (k,) float64
        Points that all trainings have reached.
    seeds : (n, k) float64
        Value of each training there.
    mean, low, high : (k,) float64
        Mean, and a band that holds the whole true mean curve with 95 %; infinite below five trainings.
    remark : str
        Which training ends much earlier than others, and cuts these; empty if none does.
    """

    name: str
    x: Values
    seeds: Values
    mean: Values
    low: Values
    high: Values
    remark: str = ""

    @property
    def has_band(self) -> bool:
        """Whether there are enough trainings for a band."""
        return len(self.seeds) >= FEWEST_FOR_BANDS

    def as_json(self) -> dict[str, Any]:
        """Return the curve as it is written to curves.json."""
        ends = {"low": self.low.tolist(), "high": self.high.tolist()} if self.has_band else {"low": None, "high": None}
        return {"seeds": len(self.seeds), "x": self.x.tolist(), "mean": self.mean.tolist(), **ends}


def joined(name: str, paths: Sequence[Path], x: str, y: str, seed: int = 0) -> LearningCurve:
    """Read the trainings of a kind, and join them at equal distances where all of them are known.

    Parameters
    ----------
    name : str
        Name of the kind.
    paths : sequence of Path
        A file or folder of each training, see `read_curve`.
    x, y : str
        Columns.
    seed : int, default 0
        Seed of the band's draws.

    Raises
    ------
    ValueError
        If a file lacks a column, has fewer than two points, or the trainings have no range in common.
    """
    read = [read_curve(path, x, y) for path in paths]
    ends = [float(line[0][-1]) for line in read]
    first, last = max(line[0][0] for line in read), min(ends)
    if not first < last:
        raise ValueError(f"the trainings of {name} have no range of {x} in common")
    remark = ""
    if last < EARLY * max(ends):
        path = paths[ends.index(last)]
        remark = f"the curves of {name} end at {x} {last:.10g}, where {path} ends; the longest ends at {max(ends):.10g}"
    grid = np.linspace(first, last, POINTS)
    seeds = np.stack([np.interp(grid, *line) for line in read])
    mean, low, high = mean_bands(seeds, seed=seed)
    return LearningCurve(name, grid, seeds, mean, low, high, remark)


def read_curve(path: Path, x: str, y: str) -> tuple[Values, Values]:
    """Return two columns of a training, in the order of the first.

    Lines that lack one of both are passed over, as trainers write columns at different times. Of a training that went
    on from an earlier step, the lines that it wrote again count.

    Parameters
    ----------
    path : Path
        A CSV file (with a header, or of step and value without), a ``.jsonl`` file, or a folder of TensorBoard, of
        which ``y`` is the name of a scalar and ``x`` is ``step``.
    x, y : str
        Columns.
    """
    lines = list(_lines(path, y))
    known = sorted({name for line in lines for name in line})
    for name in (x, y):
        if name not in known:
            nearest = difflib.get_close_matches(name, known, n=1)
            guess = f", did you mean {nearest[0]!r}?" if nearest else ""
            raise ValueError(f"{path} has no column {name!r}{guess}; it has {', '.join(known) or 'none'}")
    pairs = np.array([(line[x], line[y]) for line in lines if x in line and y in line]).reshape(-1, 2)
    pairs = pairs[np.isfinite(pairs).all(axis=1)]
    if (np.diff(pairs[:, 0]) < 0.0).all():  # the newest line is first
        pairs = pairs[::-1]
    # Where a step repeats or goes back, the training went on from there: lines before, of that step or a later one,
    # are of the run that was broken off.
    least_later = np.minimum.accumulate(np.append(pairs[1:, 0], np.inf)[::-1])[::-1]
    kept = pairs[pairs[:, 0] < least_later]
    if len(kept) < 2:
        raise ValueError(f"{path} has {len(pairs)} numbers of {y!r} by {x!r}; want two or more at different {x!r}")
    return kept[:, 0], kept[:, 1]


def _lines(path: Path, scalar: str) -> Iterator[Mapping[str, float]]:
    if path.is_dir():
        yield from _scalars(path, scalar)
    elif path.suffix == ".jsonl":
        for number, text in enumerate(read_text(path).splitlines(), 1):
            try:
                line = json.loads(text)
            except ValueError as error:
                raise ValueError(f"{path}, line {number}: not JSON ({error})") from error
            if not isinstance(line, dict):
                raise ValueError(f"{path}, line {number}: want an object with numbers by name")
            yield _numbers(line)
    else:
        rows = list(csv.reader(read_text(path).splitlines()))
        has_header = bool(rows) and any(math.isnan(_number(cell)) and cell.strip().lower() != "nan" for cell in rows[0])
        header = rows.pop(0) if has_header else [STEP, VALUE]
        for row in rows:
            yield _numbers(dict(zip(header, row, strict=False)))


def _numbers(line: Mapping[str, Any]) -> dict[str, float]:
    found = {name: _number(value) for name, value in line.items()}
    return {name: value for name, value in found.items() if not math.isnan(value)}


def _number(value: Any) -> float:  # noqa: ANN401
    try:
        return float(value)
    except (TypeError, ValueError):
        return math.nan


def _scalars(folder: Path, scalar: str) -> Iterator[Mapping[str, float]]:
    try:
        from tensorboard.backend.event_processing.event_accumulator import EventAccumulator  # type: ignore[import-untyped]
    except ModuleNotFoundError as error:
        raise ValueError(f"{folder} is read by TensorBoard: {install_command('rl')}") from error
    events = EventAccumulator(str(folder), size_guidance={"scalars": 0})
    events.Reload()
    names = events.Tags()["scalars"]
    for name in names if scalar not in names else [scalar]:
        for event in events.Scalars(name):
            yield {STEP: float(event.step), name: float(event.value)}
