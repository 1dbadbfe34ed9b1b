"""Options of a view in the browser, and how it is opened and closed."""

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING

from lidarium.scripts.common import notify

if TYPE_CHECKING:
    from lidarium.agents.policy import Policy
    from lidarium.evaluation.viewing.live_view import LiveView

PORT = 8080
"""Where the page is served where nothing is said."""


@dataclass(frozen=True, kw_only=True)
class ViewOptions:
    """Options of a view in the browser."""

    view: bool = False
    """show the run in a browser while it goes (extra viewer); its address is printed"""
    view_port: int = PORT
    """port of the page on this machine, 0 for any that is free"""
    view_stay: bool = False
    """keep the page after the run, until Ctrl-C"""


def check_view(options: ViewOptions) -> None:
    """Check what was said of a view.

    Raises
    ------
    ValueError
        Where there is no such port, or a page is to stay that is not asked for.
    """
    if not 0 <= options.view_port <= 65535:
        raise ValueError(f"--view-port is {options.view_port}; want 0 to 65535, 0 for any free port")
    if options.view_stay and not options.view:
        raise ValueError("--view-stay keeps the page of --view; want --view as well")


@contextmanager
def opened_view(options: ViewOptions, policy: "Policy", name: str) -> Iterator["list[LiveView]"]:
    """Serve a page while a run goes, and after it for as long as it is asked for.

    Parameters
    ----------
    options : ViewOptions
        Whether, and where.
    policy : Policy
        Who decides.
    name : str
        The policy's.

    Yields
    ------
    list of LiveView
        The watcher of the run; none where no view is asked for.

    Raises
    ------
    ValueError
        Where the options are no good, or the extra ``viewer`` is not installed.
    OSError
        Where the port cannot be had.
    """
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
            notify(f"the run is over; {address_of(server)} stays until Ctrl-C")
            with suppress(KeyboardInterrupt):
                view.stay()
