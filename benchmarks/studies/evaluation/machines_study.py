"""What 10^5 episodes cost, what nodes of a cluster gain, and what survives when they are killed."""

import statistics
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from lidarium.benchmarks.speed.harness.report import about, heading
from lidarium.benchmarks.studies.evaluation.machines import (
    gain_of_nodes,
    kill_nodes,
    read_again,
    run_short,
)
from lidarium.benchmarks.studies.shared.kept import Progress, do_missing, kept_lines
from lidarium.benchmarks.studies.shared.study import Study
from lidarium.evaluation.statistics.resampling import MOST_VALUES
from lidarium.mapping.files.guarded_reading import MAX_FILE_BYTES

EPISODES, PIECE = 100_000, 10_000
NODE_SEEDS, NODE_ROUNDS, LONGER = 20, 3, 2
KILLS = 50
LONG, PIECES_FILE, AGAIN_FILE, NODES_FILE, KILLS_FILE = (
    "long",
    "pieces.jsonl",
    "again.jsonl",
    "nodes.jsonl",
    "kills.jsonl",
)

PAGE = """{heading}

## 10^5 episodes

Short episodes (`random_walk` on the apartment for one simulated second, maps of 10 cm, no records) with
{workers} workers, in pieces of {piece:,} with settings of their own: what is measured is what stands around
episodes.

| episodes | a piece, each [ms] | memory of the command [MB] | `episodes.jsonl` [MB] |
|---:|---:|---:|---:|
{pieces}

With all {episodes:,} there, the command opens the file in {opened_s:.1f} s when it is called again.
`lidarium report --replays 0` takes {report_s:.0f} s and {report_mb:,.0f} MB, and its page has
{page_mb:.1f} MB.

What breaks first:

1. A report compares at most {group:,} episodes of one policy, with the same settings and number of robots.
   Its resamples take 20 kB for each, 1.3 GB at that size. Part settings, or take fewer seeds of more floors.
2. A line takes {line_bytes:,.0f} bytes. Files above {most:,.1f} GB are refused, so a folder ends at
   {limit:,.0f} episodes.
3. The report above took {mb_each:.1f} kB an episode, and a browser has to open its page.

[Run many episodes](../tutorials/run_many_episodes.md) says how to part them.

## Nodes

Two nodes of one core each beside one, on episodes of three robots; connecting and loading kernels are
included, some six seconds. To reach: 1.8 x.

| episodes | rounds | two nodes over one, median |
|---:|---:|---|
{gains}

## Killed nodes

While an evaluation ran on a cluster of three nodes, one of them was killed {killed} times (SIGKILL of all
its processes), each time after 1 to 19 more episodes, and another one joined. Of {killed_episodes:,} episodes
none was lost, doubled or changed: all lines are those of one machine.
"""


@dataclass(frozen=True, slots=True)
class Piece:
    """Some seeds of the short episodes."""

    first: int
    last: int

    @property
    def key(self) -> str:
        """Name that no other one of its file has."""
        return f"seeds {self.first} to {self.last}"


@dataclass(frozen=True, slots=True)
class Part:
    """A part that is measured, and how large it is."""

    name: str
    size: int
    turn: int = 0

    @property
    def key(self) -> str:
        """Name that no other one of its file has."""
        return f"{self.name} | {self.size} | round {self.turn}"


def work(folder: Path, _data: Path | None, every: int, workers: int) -> Progress:
    """Run an N-th of the short episodes, compare nodes, and kill an N-th as many."""
    episodes, seeds, kills = (max(whole // every, 1) for whole in (EPISODES, NODE_SEEDS, KILLS))
    pieces = [Piece(first, min(first + PIECE, episodes)) for first in range(0, episodes, PIECE)]
    yield from do_missing(
        folder / PIECES_FILE, "pieces of short episodes", pieces, partial(_run_piece, folder, workers), 1
    )
    again = [Part("again", episodes)]
    yield from do_missing(folder / AGAIN_FILE, "reading again", again, partial(_again, folder), 1)
    # The longer the work, the less the start of the nodes takes of it.
    rounds = [*(Part("nodes", seeds, turn) for turn in range(NODE_ROUNDS)), Part("nodes", LONGER * seeds)]
    yield from do_missing(folder / NODES_FILE, "comparisons of nodes", rounds, _compare, 1)
    yield from do_missing(folder / KILLS_FILE, "killed nodes", [Part("kills", kills)], _kill, 1)


def _run_piece(folder: Path, workers: int, piece: Piece) -> dict[str, Any]:
    return {**run_short(folder / LONG, piece.first, piece.last, workers), "workers": workers}


def _again(folder: Path, _part: Part) -> dict[str, Any]:
    return read_again(folder / LONG)


def _compare(part: Part) -> dict[str, Any]:
    return gain_of_nodes(part.size)


def _kill(part: Part) -> dict[str, Any]:
    return kill_nodes(part.size)


def _row(episodes: int, line: Mapping[str, Any]) -> str:
    each = 1e3 * line["seconds"] / line["episodes"]
    return f"| {episodes:,} | {each:.1f} | {line['memory_mb']:.0f} | {line['file_bytes'] / 1e6:.0f} |"


def _gain_row(episodes: int, compared: Sequence[Mapping[str, Any]]) -> str:
    gains = [line["gain"] for line in compared if line["episodes"] == episodes]
    median = statistics.median(gains)
    return f"| {episodes} | {len(gains)} | {median:.2f} x ({min(gains):.2f} to {max(gains):.2f}) |"


def page(folder: Path, command: str) -> str:
    """Return the results as markdown."""
    pieces, compared = kept_lines(folder / PIECES_FILE), kept_lines(folder / NODES_FILE)
    [again], [killed] = kept_lines(folder / AGAIN_FILE), kept_lines(folder / KILLS_FILE)
    total, rows = 0, []
    for line in pieces:
        total += line["episodes"]
        rows.append(_row(total, line))
    line_bytes = pieces[-1]["file_bytes"] / total
    return PAGE.format(
        heading="\n".join(heading("Many episodes, many machines", about(command))),
        workers=pieces[-1]["workers"],
        piece=pieces[0]["episodes"],
        pieces="\n".join(rows),
        episodes=again["episodes"],
        opened_s=again["opened_s"],
        report_s=again["report_s"],
        report_mb=again["report_mb"],
        page_mb=again["page_bytes"] / 1e6,
        line_bytes=line_bytes,
        most=MAX_FILE_BYTES / 1e9,
        group=MOST_VALUES,
        limit=round(MAX_FILE_BYTES / line_bytes, -4),
        mb_each=1e3 * again["report_mb"] / again["episodes"],
        gains="\n".join(
            _gain_row(count, compared) for count in sorted({each["episodes"] for each in compared})
        ),
        killed=killed["killed"],
        killed_episodes=killed["episodes"],
    )


STUDY = Study(page, work=work)
