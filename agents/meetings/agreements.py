"""Data that robots exchange by radio: news of all robots, and the meeting that they have agreed on.

Each robot has its own notebook. It reads the notebook of a teammate only if a message of that teammate has just
arrived: news and agreements spread from robot to robot, later if messages are lost.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated

from lidarium.mapping.geometry.bounds import check_settings, within

NEWS_BYTES, AGREEMENT_BYTES = 48, 32
"""Size of the news of a robot (name, time, pose, goal, known cells, state) and of an agreement in messages."""

Place = tuple[float, float]
"""x, y on the floor [m]."""

Seconds = Annotated[float, within(0.0, 1e6)]

RULES = ("meeting", "pursuit", "none")
"""Behaviours of a robot whose map is explored: it drives to the agreed position, follows a teammate, or waits."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MeetingSettings:
    """Parameters of meetings.

    Attributes
    ----------
    rule : str, optional
        ``meeting``, the default: robots drive to the agreed position in time for the meeting, or earlier if their map
        is explored. ``pursuit``: robots whose map is explored drive to the expected position of a teammate, as in
        M-TARE. ``none``: they wait.
    interval : float, optional
        Time to the next meeting, relative to the duration of the tours past the open frontiers. 4 by default.
    minimum_s, maximum_s : float, optional
        Minimum and maximum time to the next meeting [s]. 400 and 800 s by default.
    patience_s : float, optional
        Time that robots wait for a missing one, in addition to half of its expected driving time [s]. 20 s by default.
    trust_s : float, optional
        Age of the last news of a teammate out of touch up to which the frontiers nearest to it are left to it [s].
        20 s by default.
    """

    rule: str = "meeting"
    interval: Annotated[float, within(0.0, 1e3)] = 4.0
    minimum_s: Seconds = 400.0
    maximum_s: Seconds = 800.0
    patience_s: Seconds = 20.0
    trust_s: Seconds = 20.0

    def __post_init__(self) -> None:
        check_settings(self, "meetings")
        if self.rule not in RULES:
            raise ValueError(f"rule of meetings is {self.rule!r}; want one of {', '.join(RULES)}")
        if self.minimum_s > self.maximum_s:
            raise ValueError(f"minimum_s of meetings is {self.minimum_s}; want at most maximum_s, {self.maximum_s}")


@dataclass(frozen=True, slots=True)
class News:
    """The state of a robot at some time.

    Attributes
    ----------
    time_s : float
        Time of the state [s].
    place, goal : (x, y)
        Position and goal of the robot on the floor [m].
    known : int
        Number of free cells in its map.
    is_done : bool
        Whether its map has no frontiers left.
    """

    time_s: float
    place: Place
    goal: Place
    known: int
    is_done: bool


@dataclass(frozen=True, slots=True)
class Agreement:
    """A meeting.

    Attributes
    ----------
    number : int
        Number of the agreement; the highest one is valid.
    place : (x, y)
        Position on the floor [m].
    time_s : float
        Latest time of arrival [s].
    members : tuple of str
        Robots that take part.
    """

    number: int
    place: Place
    time_s: float
    members: tuple[str, ...]


@dataclass(slots=True)
class Notebook:
    """The knowledge of a robot about the others.

    Attributes
    ----------
    news : dict
        The latest news of each robot, including its own.
    agreement : Agreement or None
        The next meeting.
    given_up : set
        Robots that it no longer expects.
    shared : dict
        Number of free cells in its map when it last shared the map with each teammate.
    since : dict
        Time since which it has been in touch with each teammate without interruption [s].
    """

    news: dict[str, News] = field(default_factory=dict)
    agreement: Agreement | None = None
    given_up: set[str] = field(default_factory=set)
    shared: dict[str, int] = field(default_factory=dict)
    since: dict[str, float] = field(default_factory=dict)

    def read(self, news: Mapping[str, News], agreement: Agreement | None) -> None:
        """Take over newer news and a newer agreement from the notebook of a teammate."""
        for name, told in news.items():
            if name not in self.news or told.time_s > self.news[name].time_s:
                self.news[name] = told
                self.given_up.discard(name)
        if agreement is not None and (self.agreement is None or agreement.number > self.agreement.number):
            self.agreement = agreement

    def in_touch(self, me: str, after_s: float) -> list[str]:
        """Return the teammates with news after a time, received directly or through other robots."""
        return [name for name, told in self.news.items() if name != me and told.time_s >= after_s]

    def note_shared(self, me: str, after_s: float, needed_s: float) -> None:
        """Mark the map as shared with teammates that have been in touch for ``needed_s``."""
        mine, near = self.news[me], self.in_touch(me, after_s)
        self.since = {name: self.since.get(name, mine.time_s) for name in near}
        for name, since in self.since.items():
            if mine.time_s - since >= needed_s:
                self.shared[name] = mine.known

    def expects(self, me: str, after_s: float, share: float) -> list[str]:
        """Return the missing teammates that still explore, or lack more than a share of the area that this robot knows.

        Maps that were shared when both were last in touch count as known to the teammate.
        """
        known, near = self.news[me].known, set(self.in_touch(me, after_s))
        return [
            name
            for name, told in self.news.items()
            if name != me
            and name not in near
            and name not in self.given_up
            and (not told.is_done or known - self.shared.get(name, 0) > share * known)
        ]


def next_meeting_s(settings: MeetingSettings, tour_m: float, robots: int, speed: float) -> float:
    """Return the time to the next meeting [s], in proportion to each robot's part of the tour past open frontiers."""
    taken = settings.interval * tour_m / (robots * speed)
    return min(max(taken, settings.minimum_s), settings.maximum_s)


def tour_length(start: Place, places: list[Place]) -> float:
    """Return the straight-line length of the nearest-neighbour tour through some positions [m]."""
    here, left, length = start, list(places), 0.0
    while left:
        nearest = min(left, key=lambda place: (math.dist(here, place), place))
        length += math.dist(here, nearest)
        left.remove(nearest)
        here = nearest
    return length
