"""The table of the speed benchmarks: one line per comparison."""

import argparse
import datetime
import json
import os
import platform
import statistics
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from timing import QUICK, Comparison, Effort, compared, pin, rate

NOT_INSTALLED = "peer not installed"


@dataclass(frozen=True, slots=True)
class Line:
    """A comparison.

    Attributes
    ----------
    name : str
        What is compared.
    ours : str
        Our figure, with its unit.
    peer : str
        The other side's figure, and who it is.
    ratio : Comparison or None
        Our speed over theirs; None where the peer is not installed or the line is not a ratio.
    figure : float or None
        The figure that is judged where the line is not a ratio of speeds.
    to_reach : float or None
        What was to be reached; None where the line only informs.
    is_upper_bound : bool
        Whether the figure must stay below ``to_reach``.
    unit : str
        Of ``to_reach``: ``x`` or a unit.
    """

    name: str
    ours: str
    peer: str
    ratio: Comparison | None
    to_reach: float | None
    figure: float | None = None
    is_upper_bound: bool = False
    unit: str = "x"

    @property
    def judged(self) -> float | None:
        """The figure that is held against ``to_reach``."""
        return self.figure if self.ratio is None else self.ratio.median

    @property
    def is_reached(self) -> bool | None:
        """Whether it is reached; None where nothing was measured."""
        if self.judged is None or self.to_reach is None:
            return None
        return self.judged <= self.to_reach if self.is_upper_bound else self.judged >= self.to_reach


def faster(
    name: str, ours: Sequence[float], peer_name: str, peer: Sequence[float] | None, to_reach: float | None, unit: str = "agent steps/s"
) -> Line:
    """Make the line of a measured peer; ``peer`` is None where it is not installed."""
    own = f"{shown(rate(list(ours)))} {unit}"
    if peer is None:
        return Line(name, own, f"{peer_name}: {NOT_INSTALLED}", None, to_reach)
    return Line(name, own, f"{peer_name}: {shown(rate(list(peer)))}", compared(list(ours), list(peer)), to_reach)


def faster_than_quoted(
    name: str, ours: Sequence[float], peer_name: str, quoted: float, to_reach: float, unit: str = "agent steps/s"
) -> Line:
    """Make the line of a peer whose rate is quoted, not measured here."""
    ratios = [1.0 / (seconds * quoted) for seconds in ours]
    comparison = Comparison(statistics.median(ratios), min(ratios), max(ratios))
    return Line(name, f"{shown(rate(list(ours)))} {unit}", f"{peer_name}: {shown(quoted)} (quoted)", comparison, to_reach)


def shown(value: float) -> str:
    """Write a rate with three digits."""
    if value >= 1e6:
        return f"{value / 1e6:.3g} M"
    if value >= 1000.0:
        return f"{round(value, -max(len(str(int(value))) - 3, 0)):,.0f}"
    return f"{value:.3g}"


def table(lines: Sequence[Line]) -> str:
    """Write the lines as a markdown table."""
    rows = ["| line | ours | peer | ratio (least to greatest) | to reach | reached |", "|---|---|---|---|---|---|"]
    for line in lines:
        judged = "-" if line.judged is None else f"{line.judged:.3g} {line.unit}"
        if line.ratio is not None:
            judged = f"{line.ratio.median:.3g} x ({line.ratio.least:.3g} to {line.ratio.greatest:.3g})"
        wanted = "-" if line.to_reach is None else f"{'<=' if line.is_upper_bound else '>='} {line.to_reach:,g} {line.unit}"
        reached = {True: "yes", False: "no", None: "-"}[line.is_reached]
        rows.append(f"| {line.name} | {line.ours} | {line.peer} | {judged} | {wanted} | {reached} |")
    return "\n".join(rows)


def machine() -> str:
    """Say in words what this runs on."""
    model = platform.processor() or platform.machine()
    information = Path("/proc/cpuinfo")
    if information.exists():
        names = [line.split(":", 1)[1].strip() for line in information.read_text().splitlines() if line.startswith("model name")]
        model = names[0] if names else model
    return f"{model}, {os.cpu_count()} cores, {platform.system()}"


def versions(extra: dict[str, str] | None = None) -> dict[str, str]:
    """Return the versions of what took part."""
    found = {"Python": platform.python_version()}
    for package in ("lidarium", "numpy", "numba", "opencv-python-headless", "ir-sim", "pybullet"):
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            continue
    return found | (extra or {})


def write(lines: Sequence[Line], folder: Path, command: str, effort: Effort, extra_versions: dict[str, str], notes: Sequence[str]) -> None:
    """Write ``speed.md`` and ``speed.json``, each beside and then renamed."""
    folder.mkdir(parents=True, exist_ok=True)
    date = datetime.datetime.now(datetime.UTC).date().isoformat()
    installed = versions(extra_versions)
    about = {"command": command, "date": date, "machine": machine(), "versions": installed}
    content = {
        **about,
        "rounds": effort.rounds,
        "block_s": effort.block_s,
        "lines": [asdict(line) | {"is_reached": line.is_reached} for line in lines],
        "notes": list(notes),
    }
    listed = ", ".join(f"{name} {number}" for name, number in installed.items())
    text = "\n".join(
        [
            "# Speed",
            "",
            f"Measured with `{command}` on {date}: {machine()}; {listed}. One process on one core.",
            f"Each line is the median of {effort.rounds} rounds in which all contenders run in turn for {effort.block_s:g} s each; "
            "ratios are taken round by round, with their least and greatest.",
            "",
            table(lines),
            "",
            "## What the lines mean",
            "",
            *(f"- {note}" for note in notes),
            "",
        ]
    )
    for name, body in (("speed.md", text), ("speed.json", json.dumps(content, indent=1) + "\n")):
        beside = folder / f".{name}.part"
        beside.write_text(body, encoding="utf-8")
        beside.replace(folder / name)


def run_alone(measure: Callable[[Effort], list[Line]], description: str) -> None:
    """Run one benchmark from the command line and print its lines."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--quick", action="store_true", help="few short rounds, to see that it works")
    pin()
    print(table(measure(QUICK if parser.parse_args().quick else Effort())))
