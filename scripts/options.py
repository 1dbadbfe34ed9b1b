"""Options that several commands share: settings of policies and the supervisor, films, the live view, ROS 2."""

from collections.abc import Container, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from tyro.conf import arg

from lidarium.extras import install_command
from lidarium.scripts.common import Command, notify

if TYPE_CHECKING:
    from lidarium.agents.policy import Policy
    from lidarium.envs.ros.graph import Graph
    from lidarium.evaluation.drawing.films import FilmSettings
    from lidarium.evaluation.viewing.live_view import LiveView


def policy_options(assignments: Iterable[str]) -> dict[str, Any]:
    """Return settings of a policy by name."""
    from lidarium.envs.settings.making import value_of

    options: dict[str, Any] = {}
    for assignment in assignments:
        key, equals, text = assignment.partition("=")
        if not equals or not key.strip():
            raise ValueError(f"--policy-set {assignment!r} sets nothing; want KEY=VALUE, such as kept=2.0")
        options[key.strip().replace("-", "_")] = value_of(text.strip())
    return options


def options_by_policy(assignments: Iterable[str], policies: Sequence[str]) -> dict[str, dict[str, Any]]:
    """Return settings of several policies, by the names of policy and setting."""
    options: dict[str, dict[str, Any]] = {}
    for assignment in assignments:
        name, dot, rest = assignment.partition("=")[0].rpartition(".")
        if not dot or name not in policies:
            raise ValueError(
                f"--policy-set {assignment!r} names no policy that is evaluated; want POLICY.KEY=VALUE with "
                f"one of {', '.join(policies)}"
            )
        options.setdefault(name, {}).update(policy_options([rest + assignment[len(name) + 1 + len(rest) :]]))
    return options


PREFIX = "--supervisor."


def gathered(words: Sequence[str], lists: Container[str] = ()) -> list[str]:
    """Return a command line in which options that take several words stand once, at its end.

    ``--set A --set B`` becomes ``--set A B``. ``--supervisor.KEY VALUE`` and ``--supervisor.KEY=VALUE`` become
    ``--supervisor KEY=VALUE``; dashes in a key are underscores.

    Parameters
    ----------
    lists : container of str
        Options that take several words, with dashes.
    """
    rest: list[str] = []
    found: dict[str, list[str]] = {}
    taking, left = rest, iter(words)
    for word in left:
        option, equals, value = word.partition("=")
        name = option.replace("_", "-")
        if word.startswith(PREFIX):
            if not equals:
                value = next(left, "--")
                if value.startswith("--"):
                    raise ValueError(f"{word} has no value; want {word} VALUE")
            key = option.removeprefix(PREFIX).replace("-", "_")
            found.setdefault("--supervisor", []).append(f"{key}={value}")
            taking = rest
        elif name in lists:
            taking = found.setdefault(name, [])
            if equals:
                taking.append(value)
                taking = rest
        else:
            taking = rest if word.startswith("--") else taking
            taking.append(word)
    return [*rest, *(word for option, taken in found.items() for word in (option, *taken))]


def supervisor_options(assignments: Iterable[str]) -> dict[str, Any]:
    """Return settings of the supervisor by name."""
    from dataclasses import fields

    from lidarium.agents.supervisor.settings import SupervisorSettings
    from lidarium.envs.settings.making import value_of
    from lidarium.registry import unknown

    known = [each.name for each in fields(SupervisorSettings)]
    options: dict[str, Any] = {}
    for assignment in assignments:
        key, equals, text = assignment.partition("=")
        if not equals:
            raise ValueError(f"--supervisor {assignment!r} sets nothing; want KEY=VALUE, such as period_s=5")
        if key not in known:
            raise ValueError(unknown("setting of the supervisor", key, known))
        options[key] = value_of(text.strip())
    SupervisorSettings(**options)
    return options


def is_supervised(name: str) -> bool:
    """Return whether a policy is led by a configurable supervisor."""
    from lidarium.agents import make_policy
    from lidarium.agents.supervisor.policy import Supervised

    return isinstance(make_policy(name), Supervised)


def check_supervised(name: str) -> None:
    """Check that a policy is led by a configurable supervisor."""
    from lidarium.agents import policy_names

    if not is_supervised(name):
        led = ", ".join(filter(_can_be_led, policy_names()))
        raise ValueError(f"settings of the supervisor are given, and policy {name!r} has none; want one of {led}")


def _can_be_led(name: str) -> bool:
    """Return whether a policy is led by a supervisor, and can be made here."""
    try:
        return is_supervised(name)
    except ValueError:  # weights of a network are missing or damaged
        return False


@dataclass(frozen=True, kw_only=True)
class FilmOptions:
    """Options of films."""

    film_speed: Annotated[float, arg(aliases=["--video-speed"])] = 10.0
    """simulated seconds per second of a film"""
    film_width: int | None = None
    """most pixels that a film is wide; 980 of an mp4, 640 of a GIF and a WebP by default"""
    film_fps: float | None = None
    """frames per second of a film; 20 of an mp4, 10 of a GIF and a WebP by default"""

    @property
    def film_settings(self) -> "FilmSettings":
        """Settings of films."""
        from lidarium.evaluation.drawing.films import FilmSettings

        return FilmSettings(self.film_speed, self.film_width, self.film_fps)


@dataclass(frozen=True, kw_only=True)
class FilmFiles(FilmOptions):
    """Output files for films of records."""

    gif: Path | None = None
    """write a film as an animated picture; its name ends in .gif or .webp"""
    video: Path | None = None
    """write a film as a video; its name ends in .mp4"""

    @property
    def films(self) -> list[Path]:
        """The films that are asked for."""
        return [path for path in (self.gif, self.video) if path is not None]

    def check_films(self) -> None:
        """Check that the films can be made, before anything is written."""
        from lidarium.evaluation.drawing.films import format_of
        from lidarium.mapping.files.output import check_writable

        for path in self.films:
            check_writable(path.parent)
            format_of(path)
            if path.is_dir():
                raise IsADirectoryError(f"cannot write to {path}: it is a folder; want a new name")
        assert self.film_settings


PORT = 8080
"""Default port of the page."""


@dataclass(frozen=True, kw_only=True)
class ViewOptions:
    """Options of a view in the browser."""

    view: bool = False
    """show the run in a browser while it runs (extra viewer); its address is printed"""
    view_port: int = PORT
    """port of the page on this machine, 0 for any that is free"""
    view_stay: bool = False
    """keep the page after the run, until Ctrl-C"""


def check_view(options: ViewOptions) -> None:
    """Check the options of a view."""
    if not 0 <= options.view_port <= 65535:
        raise ValueError(f"--view-port is {options.view_port}; want 0 to 65535, 0 for any free port")
    if options.view_stay and not options.view:
        raise ValueError("--view-stay keeps the page of --view; want --view as well")


@contextmanager
def opened_view(options: ViewOptions, policy: "Policy", name: str) -> Iterator["list[LiveView]"]:
    """Serve a page during a run, and afterwards as long as requested."""
    check_view(options)
    if not options.view:
        yield []
        return
    from lidarium.evaluation.viewing.live_view import LiveView
    from lidarium.evaluation.viewing.server import address_of, view_server

    with view_server(options.view_port) as server:
        notify(f"the run is shown at {address_of(server)}")
        view = LiveView(server, policy, name)
        yield [view]
        if options.view_stay and view.has_ended:
            with suppress(KeyboardInterrupt):
                notify(f"the run is over; {address_of(server)} stays until Ctrl-C")
                view.stay()


@dataclass(frozen=True, kw_only=True)
class RosOptions(Command):
    """Options of commands that speak ROS 2."""

    domain: int | None = None
    """domain, 0 to 232; ROS_DOMAIN_ID, else 0, if not given"""
    localhost: bool = False
    """reach only programs on this machine, without multicast; ROS_LOCALHOST_ONLY=1 does the same"""
    humble: bool = False
    """the other nodes run Humble, which names nodes in another form than Iron and later"""


def open_graph(options: RosOptions, node: str) -> "Graph":
    """Return a node of ROS 2; ValueError if the packages of the extra are not installed."""
    try:
        from lidarium.envs.ros.graph import Graph
    except ImportError as error:
        package = str(error.name).partition(".")[0]
        raise ValueError(f"ROS 2 needs the package {package}: {install_command('ros')}") from error
    return Graph(node, options.domain, localhost=options.localhost or None, is_humble=options.humble)
