"""`lidarium curves`: draw learning curves of trainings from several seeds, with simultaneous bands."""

import glob
from dataclasses import dataclass
from pathlib import Path

from tyro.conf import Positional

from lidarium.scripts.common import Answer, Command, notify, table


@dataclass(frozen=True, kw_only=True)
class _Curves(Command):
    """Join the learning curves of trainings that differ by their seed, and draw them.

    Writes curves.png and curves.json to --out, or to runs/curves. A band holds the whole mean curve with 95 %.
    """

    trainings: Positional[tuple[str, ...]]
    """kinds of trainings as NAME=PATTERN, such as PPO='runs/ppo-*/progress.csv': CSV, .jsonl or TensorBoard folders"""
    x: str = "step"
    """column of the horizontal axis"""
    y: str = "value"
    """column of the vertical axis"""


def execute(command: _Curves) -> Answer:
    """Join and draw learning curves."""
    from lidarium.evaluation.analysis.learning_curves import joined
    from lidarium.evaluation.drawing.curves_picture import save_learning_curves
    from lidarium.evaluation.statistics import FEWEST_FOR_BANDS
    from lidarium.mapping.files.output import check_writable, write_json

    out = command.out or Path("runs") / "curves"
    check_writable(out)
    files = _files(command.trainings)
    curves = [joined(name, paths, command.x, command.y, command.seed) for name, paths in files.items()]
    few = [curve for curve in curves if not curve.has_band]
    remarks = [curve.remark for curve in curves if curve.remark]
    remarks += [f"{curve.name} has {len(curve.seeds)} trainings: no band below {FEWEST_FOR_BANDS}" for curve in few]
    for remark in remarks:
        notify(remark)
    save_learning_curves(out / "curves.png", curves, command.x, command.y)
    result = {
        "x": command.x,
        "y": command.y,
        "confidence": 0.95,
        "curves": {curve.name: curve.as_json() for curve in curves},
        "remarks": remarks,
    }
    write_json(out / "curves.json", result)
    rows = []
    for curve in curves:
        ends = f"{curve.low[-1]:.4g} to {curve.high[-1]:.4g}" if curve.has_band else "-"
        rows.append((curve.name, len(curve.seeds), f"{curve.x[-1]:g}", f"{curve.mean[-1]:.4g}", ends))
    header = ("trainings", "seeds", command.x, f"mean {command.y}", "95 % band there")
    return Answer({"folder": str(out), **result}, f"{table([header, *rows])}\n{out}: curves.png, curves.json")


def _files(trainings: tuple[str, ...]) -> dict[str, list[Path]]:
    """Return the files of each kind of training."""
    found: dict[str, list[Path]] = {}
    for given in trainings:
        name, equals, pattern = given.partition("=")
        if not (name and equals and pattern):
            raise ValueError(f"trainings {given!r}; want NAME=PATTERN, such as PPO='runs/ppo-*/progress.csv'")
        if name in found:
            raise ValueError(f"two kinds of trainings are called {name!r}; want a name for each")
        found[name] = [Path(path) for path in sorted(glob.glob(pattern))]
        if not found[name]:
            raise ValueError(f"no file is like {pattern!r} ({name})")
    return found
