"""The lines of the speed table: one comparison each, with its target."""

import statistics
from collections.abc import Sequence
from dataclasses import dataclass

from lidarium.benchmarks.speed.harness.timing import Comparison, compared, rate

NOT_INSTALLED = "peer not installed"


@dataclass(frozen=True, slots=True)
class Line:
    """A comparison.

    `name`: what is compared; `ours`: our figure, with its unit; `peer`: the other side's figure, and who it is;
    `ratio`: our speed over theirs; None if the peer is not installed or the line is not a ratio; `figure`: the figure
    that is judged if the line is not a ratio of speeds; `to_reach`: what was to be reached; None if the line only
    informs; `is_upper_bound`: whether the figure must stay below ``to_reach``; `unit`: of ``to_reach``: ``x`` or a
    unit.
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
        """Whether it is reached; None if nothing was measured."""
        if self.judged is None or self.to_reach is None:
            return None
        return self.judged <= self.to_reach if self.is_upper_bound else self.judged >= self.to_reach

    @property
    def cells(self) -> tuple[str, str, str, str, str, str]:
        """The cells of the line in the table.

        They are name, ours, peer, ratio with its range, the target, and whether it is reached.
        """
        judged = "-" if self.judged is None else f"{shown(self.judged)} {self.unit}"
        if self.ratio is not None:
            judged = f"{shown(self.ratio.median)} x ({shown(self.ratio.least)} to {shown(self.ratio.greatest)})"
        wanted = (
            "-" if self.to_reach is None else f"{'<=' if self.is_upper_bound else '>='} {self.to_reach:,g} {self.unit}"
        )
        return (self.name, self.ours, self.peer, judged, wanted, {True: "yes", False: "no", None: "-"}[self.is_reached])


def faster(
    name: str,
    ours: Sequence[float],
    peer_name: str,
    peer: Sequence[float] | None,
    to_reach: float | None,
    unit: str = "agent steps/s",
) -> Line:
    """Make the line of a measured peer; ``peer`` is None if it is not installed."""
    own = f"{shown(rate(ours))} {unit}"
    if peer is None:
        return Line(name, own, f"{peer_name}: {NOT_INSTALLED}", None, to_reach)
    return Line(name, own, f"{peer_name}: {shown(rate(peer))}", compared(ours, peer), to_reach)


def faster_than_quoted(
    name: str, ours: Sequence[float], peer_name: str, quoted: float, to_reach: float, unit: str = "agent steps/s"
) -> Line:
    """Make the line of a peer whose rate is quoted, not measured here."""
    ratios = [1.0 / (seconds * quoted) for seconds in ours]
    comparison = Comparison(statistics.median(ratios), min(ratios), max(ratios))
    return Line(name, f"{shown(rate(ours))} {unit}", f"{peer_name}: {shown(quoted)} (quoted)", comparison, to_reach)


def within(
    name: str, ours: Sequence[float], part_name: str, part: Sequence[float], allowed: float, unit: str = "agent steps/s"
) -> Line:
    """Make the line of a whole that may take that many times as long as a part. Both are in seconds per unit."""
    own, other = f"{shown(rate(ours))} {unit}", f"{part_name}: {shown(rate(part))}"
    return Line(
        f"{name} (time over that of the {part_name})", own, other, compared(part, ours), allowed, is_upper_bound=True
    )


def needs_threads(name: str, to_reach: float, is_upper_bound: bool = False) -> Line:
    """Make the line of a quantity that cannot be measured here. Only one thread can run at a time."""
    return Line(name, "needs two cores", "-", None, to_reach, is_upper_bound=is_upper_bound)


def shown(value: float) -> str:
    """Write a rate with three digits."""
    if value >= 999_500.0:
        return f"{value / 1e6:.3g} M"
    if value >= 999.5:
        return f"{round(value, -max(len(str(int(value))) - 3, 0)):,.0f}"
    return f"{value:.3g}"


def table(lines: Sequence[Line]) -> str:
    """Write the lines as a markdown table."""
    header = "| line | ours | peer | ratio (least to greatest) | to reach | reached |"
    return "\n".join([header, "|---|---|---|---|---|---|", *(f"| {' | '.join(line.cells)} |" for line in lines)])
