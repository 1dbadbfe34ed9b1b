"""What robots tell each other by radio: news of everybody, and the meeting that they have agreed on.

Each robot has a notebook of its own. It reads the notebook of a teammate only when a message of that teammate has
just come, so that news and agreements spread from robot to robot, and late if messages are lost.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated

from lidarium.mapping.geometry.bounds import check_settings, within

NEWS_BYTES, AGREEMENT_BYTES = 48, 32
"""A line of news: robot, time, pose and goal, cells known, state. An agreement: number, place, time, members."""

Place = tuple[float, float]
"""x, y on the floor [m]."""

Seconds = Annotated[float, within(0.0, 1e6)]

RULES = ("meeting", "pursuit", "none")
"""What a robot does that has nothing left to explore: it goes to the agreed place, after a teammate, or rests."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MeetingSettings:
    """How robots agree on meetings.

    Attributes
    ----------
    rule : str
        ``meeting`` (robots go to the agreed place at the agreed time, or when they have nothing left), ``pursuit``
        (those that have nothing left go where they expect a teammate, as in M-TARE) or ``none``.
    interval : float
        Time to the next meeting over the time that the tours past the open frontiers take [1].
    minimum_s, maximum_s : float
        Bounds of that time [s].
    patience_s : float
        How long robots wait for one that does not come, beside half of the time of its way [s].
    trust_s : float
        For how long robots leave to a teammate out of reach what lies nearest to it [s].
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
    """What is known of a robot.

    Attributes
    ----------
    time_s : float
        When it was true [s].
    place, goal : (x, y)
        Where the robot was, and where it was driving to [m].
    known : int
        Number of cells that it knew to be free.
    is_done : bool
        Whether its map had nothing left to explore.
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
        Later agreements have higher numbers.
    place : (x, y)
        Where [m].
    time_s : float
        When, at the latest [s].
    members : tuple of str
        Who comes.
    """

    number: int
    place: Place
    time_s: float
    members: tuple[str, ...]


@dataclass(slots=True)
class Notebook:
    """What a robot knows of the others.

    Attributes
    ----------
    news : dict
        The latest news of each robot, its own among them.
    agreement : Agreement or None
        The meeting that it goes to.
    given_up : set
        Whom it does not wait for any more.
    shared : dict
        Number of free cells that it knew when it last shared its map with each teammate.
    since : dict
        Since when it has been in touch with each teammate, without a break [s].
    """

    news: dict[str, News] = field(default_factory=dict)
    agreement: Agreement | None = None
    given_up: set[str] = field(default_factory=set)
    shared: dict[str, int] = field(default_factory=dict)
    since: dict[str, float] = field(default_factory=dict)

    def read(self, news: Mapping[str, News], agreement: Agreement | None) -> None:
        """Take over what a teammate tells that is newer."""
        for name, told in news.items():
            if name not in self.news or told.time_s > self.news[name].time_s:
                self.news[name] = told
                self.given_up.discard(name)
        if agreement is not None and (self.agreement is None or agreement.number > self.agreement.number):
            self.agreement = agreement

    def in_touch(self, me: str, after_s: float) -> list[str]:
        """Return the teammates of which there is news after a time, directly or from robot to robot."""
        return [name for name, told in self.news.items() if name != me and told.time_s >= after_s]

    def note_shared(self, me: str, after_s: float, needed_s: float) -> None:
        """Note with whom the map has been shared: who has been in touch for as long as that takes."""
        mine, near = self.news[me], self.in_touch(me, after_s)
        self.since = {name: self.since.get(name, mine.time_s) for name in near}
        for name, since in self.since.items():
            if mine.time_s - since >= needed_s:
                self.shared[name] = mine.known

    def expects(self, me: str, after_s: float, share: float) -> list[str]:
        """Return the teammates that are worth meeting: they lack what this robot knows, or may know what it lacks.

        A teammate must know by now what it was told when both were last in touch.
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
    """Return the time to the next meeting: that of the robots' part of the tour past what is open [s]."""
    taken = settings.interval * tour_m / (robots * speed)
    return min(max(taken, settings.minimum_s), settings.maximum_s)


def tour_length(start: Place, places: list[Place]) -> float:
    """Return the length of a tour as the crow flies, always to the nearest place left [m]."""
    here, left, length = start, list(places), 0.0
    while left:
        nearest = min(left, key=lambda place: (math.dist(here, place), place))
        length += math.dist(here, nearest)
        left.remove(nearest)
        here = nearest
    return length
