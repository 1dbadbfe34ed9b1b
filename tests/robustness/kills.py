"""Evaluations and trainings that are killed at random moments, they or their workers, and go on.

``python -m robustness.kills --count 1000``, with ``--train`` for trainings

Run it in the folder ``tests``. A folder is filled by one command, called again after each kill until it ends
by itself. Then nothing may be lost or there twice: every episode, record, lesson and weight is that of a
command that nobody disturbed, and what was on the disk once stays there.
"""

import argparse
import collections
import hashlib
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path

from lidarium.evaluation.suites.episodes_file import TIMINGS

VICTIMS = ("parent", "worker", "all")
PROGRAM = "import sys; from lidarium.scripts.main import main; sys.exit(main())"
TEAM = ("--floors", "srt_l_room", "--policies", "random_walk", "--robots", "1", "--workers", "2")
SHORT = ("--horizon-s", "1", "--map-resolution", "0.1", "--lidar", "lidar_360_6m")
TRAINING = """
seed = 1
settings = { resolution = 0.1, horizon_s = 600.0, stop_coverage = 0.9 }
rounds = [{ floors = 3, kinds = { apartment = 1.0 }, robots = [1] }]
fit = { epochs = 2, batch = 4 }
ppo = { decisions = 24, checkpoint = 8, environments = 1, steps = 8, batch = 8, epochs = 1 }
validation = { floors = ["apartment:7"], robots = [1] }
"""
ENDS = (".safetensors", ".npz", ".none", "fit.json", "training.json")
"""How the files of a training end that are the same whenever it is run."""

ENDS_S = 120.0
"""How long an evaluation may take to end when it is left alone [s]."""

WORKS_S = 0.5
"""How long after a command of hardly any episodes has ended one of many may be killed [s]."""

LEAVES_S = 10.0
"""How long workers may outlive their parent [s]."""


@dataclass
class Tally:
    """What came of the kills.

    Attributes
    ----------
    kills : counter of str
        How many there were, by who was killed.
    folders : int
        How many evaluations were completed.
    faults : list of str
        What was lost, doubled or left over.
    """

    kills: collections.Counter[str] = field(default_factory=collections.Counter)
    folders: int = 0
    faults: list[str] = field(default_factory=list)


def children_of(process: int) -> list[int]:
    """Return the processes that one has begun."""
    try:
        return [int(word) for word in Path(f"/proc/{process}/task/{process}/children").read_text().split()]
    except OSError:
        return []


@dataclass(frozen=True)
class Work:
    """What is killed.

    Attributes
    ----------
    words : tuple of str
        The command, but for where it writes.
    found_in : callable
        Returns what lies in its folder, without what differs between two runs.
    kept_in : callable
        Returns what may never go again.
    """

    words: tuple[str, ...]
    found_in: Callable[[Path], dict[str, object]]
    kept_in: Callable[[Path], set[object]]


@contextmanager
def working(work: Work, out: Path) -> Iterator["subprocess.Popen[bytes]"]:
    """Run the command in a group of processes of its own, all of which are gone at the end."""
    command = [sys.executable, "-c", PROGRAM, *work.words]
    with open(out.with_suffix(".txt"), "ab") as told:
        process = subprocess.Popen([*command, "--out", str(out)], stdout=told, stderr=told, start_new_session=True)
    try:
        yield process
    finally:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()


def evaluation(episodes: int) -> Work:
    """Return an evaluation of so many episodes."""
    words = ("evaluate", *TEAM, *SHORT, "--seeds", str(episodes))
    return Work(words, found_in, lambda out: {line for line in lines_of(out) if line.endswith(b"\n")})


def training(place: Path) -> Work:
    """Return a training whose file lies in a folder."""
    path = place / "training.toml"
    path.write_text(TRAINING)
    return Work(("train", str(path), "--workers", "2"), trained_in, lessons_in)


def kill(process: "subprocess.Popen[bytes]", victim: str, chance: random.Random) -> str:
    """Kill a command, one of its children or all; return who was killed.

    It is the command itself where it has no children yet, and nobody where it has ended.
    """
    children = children_of(process.pid)
    if process.poll() is not None:
        return ""
    if victim == "worker" and not children:
        victim = "parent"
    with suppress(ProcessLookupError):
        if victim == "all":
            os.killpg(process.pid, signal.SIGKILL)
        else:
            os.kill(process.pid if victim == "parent" else chance.choice(children), signal.SIGKILL)
    return victim


def lines_of(out: Path) -> list[bytes]:
    """Return the whole lines that are on the disk."""
    path = out / "episodes.jsonl"
    return path.read_bytes().splitlines(keepends=True) if path.exists() else []


def found_in(out: Path) -> dict[str, object]:
    """Return what lies in a folder: every line without its times, and what tells other files apart."""
    found: dict[str, object] = {}
    for path in sorted(each for each in out.rglob("*") if each.is_file()):
        found[path.relative_to(out).as_posix()] = hashlib.sha256(path.read_bytes()).hexdigest()
    told = [json.loads(line) for line in lines_of(out)]
    lines = [{name: value for name, value in row.items() if name not in TIMINGS} for row in told]
    found["episodes.jsonl"] = sorted(json.dumps(line, sort_keys=True) for line in lines)
    return found


def trained_in(out: Path) -> dict[str, object]:
    """Return what a training leaves, without hours and times of the clock."""
    found: dict[str, object] = {}
    for path in sorted(each for end in ENDS for each in out.rglob(f"*{end}")):
        found[path.relative_to(out).as_posix()] = hashlib.sha256(path.read_bytes()).hexdigest()
    if (out / "card.json").exists():
        card = json.loads((out / "card.json").read_text())
        found["card.json"] = {name: card[name] for name in ("best", "sha256", "validation", "rewards")}
    found["validation"] = found_in(out / "validation")["episodes.jsonl"]
    return found


def lessons_in(out: Path) -> set[object]:
    """Return the lessons and fitted weights of a training, without what is half written."""
    paths = (path.relative_to(out) for path in out.glob("round-*/**/*") if path.is_file())
    return {path.as_posix() for path in paths if not any(part.startswith(".") for part in path.parts)}


def has_left(group: int) -> bool:
    """Whether no process of a group is left, after a while."""
    ends = time.monotonic() + LEAVES_S
    while time.monotonic() < ends:
        try:
            os.killpg(group, 0)
        except ProcessLookupError:
            return True
        time.sleep(0.02)
    return False


def complete(work: Work, out: Path) -> int:
    """Run the command until it ends; return its exit code."""
    with working(work, out) as process:
        return process.wait(ENDS_S)


def kill_some(work: Work, out: Path, lasts_s: float, chance: random.Random, tally: Tally) -> bool:
    """Run the command and kill workers until its own turn comes; return whether it ended before."""
    before = work.kept_in(out)
    with working(work, out) as process:
        killed = "worker"
        while killed == "worker":  # the others go on without it
            with suppress(subprocess.TimeoutExpired):
                process.wait(chance.uniform(0.0, lasts_s))
            killed = kill(process, chance.choice(VICTIMS), chance)
            tally.kills[killed] += bool(killed)
        process.wait(ENDS_S)
        if killed and not has_left(process.pid):
            tally.faults.append(f"{out.name}: workers outlive their parent")
        if before - work.kept_in(out):
            tally.faults.append(f"{out.name}: what was on the disk is gone")
        return not killed


def check(work: Work, out: Path, expected: dict[str, object], tally: Tally) -> None:
    """Complete a command and compare what it leaves."""
    code = complete(work, out)
    tally.folders += 1
    if code != 0:
        tally.faults.append(f"{out.name}: exit code {code}")
    found = work.found_in(out)
    different = [name for name in {*expected, *found} if expected.get(name) != found.get(name)]
    if different:
        tally.faults.append(f"{out.name}: {sorted(different)[:5]} differ")


def run_kills(count: int, seed: int = 0, episodes: int = 300, *, trains: bool = False) -> Tally:
    """Kill so many times, folder after folder; return what came of it."""
    tally, number = Tally(), 0
    with tempfile.TemporaryDirectory() as kept:
        place = Path(kept)
        work = training(place) if trains else evaluation(episodes)
        if complete(work, place / "whole") != 0:
            raise RuntimeError((place / "whole.txt").read_text())
        began, expected = time.monotonic(), work.found_in(place / "whole")
        complete(work if trains else evaluation(2), place / "few")
        lasts_s = time.monotonic() - began + WORKS_S
        while tally.kills.total() < count:
            chance, out = random.Random(f"{seed} {number}"), place / f"out{number}"
            while tally.kills.total() < count and not kill_some(work, out, lasts_s, chance, tally):
                pass
            check(work, out, expected, tally)
            shutil.rmtree(out)
            number += 1
    return tally


def main() -> int:
    """Kill as often as the command line asks for, and print what came of it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--episodes", type=int, default=300)
    parser.add_argument("--train", action="store_true")
    asked = parser.parse_args()
    began = time.monotonic()
    tally = run_kills(asked.count, asked.seed, asked.episodes, trains=asked.train)
    print(*tally.faults[:100], sep="\n")
    print(
        f"{tally.kills.total()} kills {dict(+tally.kills)} of {tally.folders} folders in "
        f"{time.monotonic() - began:.0f} s: {len(tally.faults)} faults"
    )
    return 1 if tally.faults else 0


if __name__ == "__main__":
    sys.exit(main())
