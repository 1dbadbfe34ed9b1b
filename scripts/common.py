"""Common parts of all commands.

Their options, their answers, and how they report progress.
"""

import json
import math
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import closing, nullcontext, suppress
from dataclasses import dataclass, field
from fnmatch import fnmatch
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, TypeVar

from tyro.conf import Suppress

from lidarium.registry import registry

if TYPE_CHECKING:
    from lidarium.envs.faces.parallel import ExplorationEnv

T = TypeVar("T")

DONE, BAD_INPUT, NO, DOUBTFUL, INTERRUPTED, TERMINATED, DEFECT = 0, 2, 3, 4, 130, 143, 1
"""Exit codes."""

LINE_PERIOD_S = 5.0
"""Wall time between lines of progress if there is no terminal [s]."""


@dataclass(frozen=True, kw_only=True)
class Command:
    """Options of every command."""

    seed: int = 0
    """seed of all draws, zero or more; commands without chance ignore it"""
    out: Path | None = None
    """folder for the files that the command writes"""
    json: bool = False
    """print the result as JSON on standard output, and nothing else there"""
    given: Suppress[frozenset[str]] = frozenset()
    """Names of the options given on the command line, including those set to their default."""

    compiles: ClassVar[bool] = False
    """Whether the command calls kernels, which the first start compiles."""

    writes: ClassVar[bool] = True
    """Whether the command has files for ``out``."""

    def __post_init__(self) -> None:
        if self.seed < 0:
            raise ValueError(f"seed is {self.seed}; want zero or more")

    def refuse(self, why: str, *names: str) -> None:
        """Refuse options that are given and have no effect, for the reason that is told."""
        for name in names:
            if name in self.given:
                raise ValueError(f"--{name.replace('_', '-')} is given, but {why}; leave it out")


_OPTION_OF = {
    "occupancy.resolution": "map_resolution",
    "known_starts": "unknown_starts",
    "resolution": "map_resolution",
    "max_cycles": "horizon_s",
}
"""Options by the names of settings that they set, if these differ."""


_OPTIONS_ALONE = ("robots", "realism", "noise", "resolution", "max_cycles")
"""What options set and ``set`` does not: commands depend on it, or it sets several settings."""


@dataclass(frozen=True, kw_only=True)
class TeamCommand(Command):
    """Options of commands that let a team explore."""

    robot: str = "kobuki"
    """body of the robots; `lidarium show robots` lists them"""
    lidar: str | None = None
    """laser of the robots, urg unless realism sets it; `lidarium show lidars` lists them"""
    camera: str | None = None
    """depth camera of the robots; `lidarium show cameras` lists them"""
    realism: str = "ideal"
    """how real the world is: ideal, lab, field or fast; the options below change parts of it"""
    backend: str | None = None
    """simulation of the bodies: kinematic or bullet; `lidarium show backends` lists them"""
    noise: str | None = None
    """noise of the laser's ranges: none, datasheet or thesis"""
    odometry: str | None = None
    """how well wheels measure the path: ideal, good, typical or poor"""
    localization: str | None = None
    """source of the robots' poses: truth, odometry or a localizer.

    `lidarium show localizers` lists them
    """
    radio: str | None = None
    """how robots reach each other: all, none, range, line_of_sight or signal"""
    battery: str | None = None
    """energy of the robots: none (no limit) or kobuki.

    `lidarium show batteries` lists them
    """
    pauses_when_blocked: bool = False
    """robots that touch something, or whose path is blocked, pause.

    They pause until they are commanded to resume.
    """
    unknown_starts: bool = False
    """robots do not know their start poses, nor those of the others"""
    map_resolution: float | None = None
    """side of a cell of the maps, a whole multiple of 0.025 [m]; 0.025 unless realism sets it"""
    merging: bool = False
    """robots in reach of each other exchange and merge their maps every few seconds"""
    plans_sparsely: bool = False
    """robots drive along routes on sparse maps of their depth cameras, instead of paths on grids"""

    set: tuple[str, ...] = ()
    """any other settings as NAME=VALUE, such as reward.time=0.02 or localizer.particles=400; `lidarium show
    settings` lists them"""
    supervisor: tuple[str, ...] = ()
    """settings of the supervisor as KEY=VALUE; --supervisor.KEY VALUE is the same.

    `lidarium show supervisor` lists them
    """

    def __post_init__(self) -> None:
        super().__post_init__()
        for assignment in self.set if "set" in self.given else ():
            name = assignment.partition("=")[0].strip()
            option = _OPTION_OF.get(name, name)
            if name in _OPTIONS_ALONE or option in self.given:
                raise ValueError(
                    f"--set {assignment} sets what --{option.replace('_', '-')} does; want --{option.replace('_', '-')}"
                    " alone"
                )

    @property
    def team_options(self) -> dict[str, Any]:
        """Settings of a team as ``make_settings`` takes them.

        Options that were not given are left out.
        """
        given = {
            name: getattr(self, name)
            for name in ("lidar", "camera", "backend", "noise", "odometry", "localization", "radio", "battery")
            if getattr(self, name) is not None
        }
        starts = {"known_starts": False} if self.unknown_starts else {}
        pauses = {"pauses_when_blocked": True} if self.pauses_when_blocked else {}
        if self.map_resolution is not None or "resolution" not in registry("realism")[self.realism]:
            given["resolution"] = 0.025 if self.map_resolution is None else self.map_resolution
        return {
            "robot": self.robot,
            "realism": self.realism,
            **given,
            **starts,
            **pauses,
            **({"assigned": self.set} if self.set else {}),
        }

    @property
    def run_options(self) -> dict[str, Any]:
        """Options of ``run_episode`` that are set."""
        return {name: True for name in ("merging", "plans_sparsely") if getattr(self, name)}


@dataclass(frozen=True, slots=True)
class Answer:
    """The result of a command.

    Attributes
    ----------
    result : dict
        For ``--json``.
    text : str
        The same for people.
    code : int
        Exit code.
    """

    result: dict[str, Any] = field(default_factory=dict)
    text: str = ""
    code: int = DONE


def notify(message: str) -> None:
    """Print a message on standard error.

    If the reader closes it, the work continues.
    """
    with suppress(OSError, ValueError):  # ValueError: the stream is closed
        print(message, file=sys.stderr, flush=True)


KERNELS_OF_RUN = Path(__file__).parent / "data" / "kernels_of_run.json"
"""The kernels of ``lidarium run`` that take long; ``scripts/dev/list_kernels.py run`` writes it."""


def compile_first() -> None:
    """Compile the kernels of a run in several processes, if most are not compiled yet."""
    from lidarium.mapping.kernels.first_start import compile_listed

    compile_listed(KERNELS_OF_RUN, "the first start")


def announce_compiling() -> None:
    """Tell, at the first start, why nothing happens for a while."""
    from lidarium.mapping.kernels.compilation import is_cache_empty

    if is_cache_empty():
        notify("compiling the kernels, a minute or two; later starts find them")


def table(rows: Iterable[Sequence[object]], header: Sequence[str] = (), indent: str = "  ") -> str:
    """Return lines of aligned columns; columns of numbers to the right."""
    lines = [[str(cell) for cell in row] for row in ([header, *rows] if header else rows)]
    if not lines:
        return ""
    body = lines[1:] if header else lines
    widths = [max(len(line[k]) for line in lines) for k in range(len(lines[0]))]
    is_number = [all(line[k][:1].isdigit() for line in body if line[k]) for k in range(len(widths))]
    return "\n".join(indent + "  ".join(map(_aligned, line, widths, is_number)).rstrip() for line in lines)


def _aligned(cell: str, width: int, is_number: bool) -> str:
    return cell.rjust(width) if is_number else cell.ljust(width)


def file_name(name: str) -> str:
    """Return a name in which letters unfit for file names are replaced."""
    return "".join(letter if letter.isalnum() or letter in "._-" else "-" for letter in name).strip(".-") or "floor"


@dataclass(frozen=True, slots=True)
class Outputs:
    """The files that a command writes into a folder.

    Attributes
    ----------
    names : tuple of str
        Their names, with wildcards as in ``map-[0-9].yaml``.
    result : str
        The JSON file among them by which a folder of the same command is known.
    key : str
        A key that the file has.
    """

    names: tuple[str, ...]
    result: str
    key: str

    def check(self, folder: Path, inputs: Iterable[Path | str | None]) -> None:
        """Check that the files can be written, and replace nothing but those of the same command."""
        check_output(folder, self.names, inputs)
        if not self._is_ours(folder) and (others := self._there(folder, self.names)):
            raise ValueError(
                f"{others[0]} was not written by this command, and would be replaced; choose another folder "
                "with --out, or remove it"
            )

    def clear(self, folder: Path, names: Iterable[str] | None = None) -> list[str]:
        """Remove the files, or some of them, if they are of an earlier call; return their names.

        The result stays, to be replaced before others are written: so an interrupted call leaves a known folder.
        """
        wanted = [name for name in (self.names if names is None else names) if name != self.result]
        found = self._there(folder, wanted) if self._is_ours(folder) else []
        for path in found:
            path.unlink()
        return [path.name for path in found]

    def _there(self, folder: Path, names: Iterable[str]) -> list[Path]:
        return [path for name in names for path in sorted(folder.glob(name)) if path.is_file()]

    def _is_ours(self, folder: Path) -> bool:
        from lidarium.mapping.files.guarded_reading import read_text

        try:
            found = json.loads(read_text(folder / self.result))
        except (OSError, ValueError, RecursionError):
            return False
        return isinstance(found, dict) and self.key in found


def check_output(folder: Path, names: Iterable[str], inputs: Iterable[Path | str | None]) -> None:
    """Check that a command can write to a folder, and that it overwrites none of its inputs there.

    ``names`` are those of its files, with wildcards as in ``map*``; the image of a ROS map counts as its yaml does.
    """
    from lidarium.mapping.files.map_files import image_of
    from lidarium.mapping.files.output import check_writable

    check_writable(folder)
    patterns, read = tuple(names), [Path(each) for each in inputs if each is not None]
    for path in (each for given in read for each in (given, image_of(given)) if each is not None):
        # Writing replaces links. Check the link itself and the file that it points to.
        for place in (path.parent.resolve() / path.name, path.resolve()):
            if place.parent == folder.resolve() and any(fnmatch(place.name, pattern) for pattern in patterns):
                raise ValueError(
                    f"{path} is read, and would be overwritten in {folder}; choose another folder with --out"
                )


def counted(
    items: Iterable[T],
    total: int,
    what: str,
    is_quiet: bool,
    clock: Callable[[], float] = time.monotonic,
    done: Callable[[], int] | None = None,
) -> Iterator[T]:
    """Yield items and report how many there were; ``done`` counts those of earlier calls too.

    A bar on a terminal, otherwise a line every few seconds, on standard error.
    """
    bar: Any = None
    if not is_quiet and sys.stderr.isatty():
        from tqdm import tqdm

        bar = tqdm(desc=what, total=total, file=sys.stderr, leave=False, dynamic_ncols=True)
    last = clock()
    with nullcontext() if bar is None else closing(bar):
        for count, item in enumerate(items, 1):
            yield item
            finished = count if done is None else done()
            if bar is not None:
                bar.initial = finished - count  # rates are of this call alone
                bar.update(finished - bar.n)
            elif (now := clock()) - last >= LINE_PERIOD_S:
                last = now
                notify(f"{what}: {finished:,} of {total:,}")


class Progress:
    """Report of an episode's progress.

    A bar on a terminal, otherwise a line every few seconds, on standard error.
    """

    def __init__(self, is_quiet: bool, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock, self._last = clock, -math.inf
        self._bar: Any = None
        if not is_quiet and sys.stderr.isatty():
            from tqdm import tqdm

            bar_format = "explored {percentage:5.1f} %|{bar:40}| {desc} [{elapsed}]"
            self._bar = tqdm(total=100.0, file=sys.stderr, bar_format=bar_format, leave=False, dynamic_ncols=True)

    def show(self, env: "ExplorationEnv") -> None:
        """Show the progress of the episode."""
        scorer = env.scorer
        if self._bar is not None:
            self._bar.set_description_str(f"simulated {scorer.time:.0f} s", refresh=False)
            self._bar.update(100.0 * scorer.coverage - self._bar.n)
        elif (now := self._clock()) - self._last >= LINE_PERIOD_S:
            self._last = now
            notify(f"explored {100.0 * scorer.coverage:.1f} %, simulated {scorer.time:.0f} s")

    def close(self) -> None:
        """Take the bar away."""
        if self._bar is not None:
            self._bar.close()
            self._bar = None
