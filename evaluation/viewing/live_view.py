"""Shows a run live in a browser, in step with the wall clock."""

import time
from collections.abc import Callable, Sequence
from html import escape
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from lidarium.agents.policy import Policy
from lidarium.agents.report import GivenUp, PolicyReport
from lidarium.envs.drawing.frame_parts import team_colours
from lidarium.envs.drawing.views import CUT_M, false_colours
from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.onboard.radio.messages import Orders
from lidarium.evaluation.episodes.events import joined_groups
from lidarium.evaluation.episodes.watching import WatchedExploration, Watcher
from lidarium.evaluation.processes import is_end_asked
from lidarium.evaluation.viewing.controls import FIRST_SPEED, OF_MAPS, Controls, Layer, follow
from lidarium.evaluation.viewing.moment import Moment, moment_of
from lidarium.evaluation.viewing.scene import TeamMaps, TeamScene
from lidarium.mapping.files.guarded_reading import printable

if TYPE_CHECKING:
    from viser import ViserServer


LONGEST_WAIT_S = 0.05
"""Longest time between two looks at the controls [s]."""

MOST_BEHIND_S = 0.25
"""A run that is later than this does not hurry after the clock [s]."""


class Pace:
    """Waits until simulated time is due; it holds up a run and changes nothing of it."""

    def __init__(
        self,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self._clock, self._sleep = clock, sleep
        self._since = (0.0, 0.0, 0.0)

    def wait(
        self,
        time_s: float,
        speed: Callable[[], float],
        is_held: Callable[[], bool],
        meanwhile: Callable[[], bool],
    ) -> None:
        """Wait until a simulated time is due."""
        while True:
            now, rate = self._clock(), speed()
            wall_s, simulated_s, before = self._since
            due = wall_s + (time_s - simulated_s) / rate
            is_other = rate != before or is_held() or now - due > MOST_BEHIND_S
            if is_other:
                self._since, due = (now, time_s, rate), now
            if not is_held() and now >= due:
                return
            self._sleep(LONGEST_WAIT_S if is_held() else min(due - now, LONGEST_WAIT_S))
            if not meanwhile():
                return


MOST_EVENTS = 6
"""Maximum number of events that are listed, the latest first."""


def status_text(
    env: WatchedExploration,
    policy: str,
    report: PolicyReport,
    decisions: int,
    more: Sequence[tuple[str, str]] = (),
) -> str:
    """Return the progress of a run: time, coverage, more names and values, decisions, and states of robots."""
    name = "" if env.floor is None else env.floor.name
    joins = [] if report.supervision is None else [join for join in report.supervision.joins if join.is_used]
    rows = [
        ("Time", f"{env.scorer.time:.1f} s"),
        ("Explored", f"{100.0 * env.scorer.coverage:.1f} %"),
        *more,
        ("Decisions", f"{decisions:,}"),
    ]
    if report.supervision is not None:
        rows.append(("Maps joined", f"{len(joins):,}"))
        rows.append(("Orders", f"{len(report.supervision.orders):,}"))
    title = f"<b>{_safe(name)}</b><br>{_safe(policy)}"
    return _BOX.format("".join([title, _table(rows), _robots(env)]))


def events_text(env: WatchedExploration, report: PolicyReport) -> str:
    """Return the latest joins, orders and changes of state, the last one first."""
    events = [
        (event.time_s, f"{event.agent}: {event.what}{f' ({event.reason})' if event.reason else ''}")
        for event in env.operating.events[0]
    ]
    if report.supervision is not None:
        joins = report.supervision.joins
        events += [(join.time_s, f"{join.a} and {join.b} joined") for join in joins if join.is_used]
    if not events:
        return _BOX.format("nothing yet")
    latest = sorted(events, key=lambda event: event[0])[: -MOST_EVENTS - 1 : -1]
    return _BOX.format(_table([(_safe(words), f"{time_s:.1f} s") for time_s, words in latest]))


_BOX = '<div style="padding:4px 14px 2px;font-size:0.875em;line-height:1.5">{}</div>'
_TABLE = '<table style="width:100%;margin-top:4px;border-collapse:collapse">{}</table>'


def _safe(text: str) -> str:
    """Return text that HTML shows literally."""
    return escape(printable(text))


def _table(rows: Sequence[tuple[str, str]]) -> str:
    return _TABLE.format(
        "".join(
            f'<tr><td>{name}</td><td style="text-align:right;white-space:nowrap">{value}</td></tr>'
            for name, value in rows
        )
    )


def _robots(env: WatchedExploration) -> str:
    """Return a line for each robot: its colour, state, and distance driven."""
    lines = []
    colours = team_colours(env.settings.robots)
    for row, (agent, (red, green, blue)) in enumerate(zip(env.possible_agents, colours, strict=True)):
        dot = f'<span style="color:rgb({red},{green},{blue})">&#9679;</span>'
        lines.append((f"{dot} {agent}", f"{_doing(env, row)}, {env.world.travelled[row]:.1f} m"))
    return _table(lines)


def _doing(env: WatchedExploration, row: int) -> str:
    if env.possible_agents[row] not in env.agents:
        return "ended"
    if env.driver is None:
        return "driving"
    return env.driver.state(row).value.replace("_", " ")


FRAME_S, MAPS_S = 0.1, 0.5
"""Minimum wall time between two frames, and between two drawings of maps and words [s]."""

MAPS_SHARE = 0.1
"""Maximum share of the wall time for drawing maps."""

LOW_WALLS_M = 0.4
"""Height at which walls are cut by default if furniture is not shown [m]."""

DEPTH_SIZE = 180, 240
"""Rows and columns of the depth image at the side [pixels]."""


class LiveView(Watcher):
    """A page that shows the run at hand; the run is the same to the bit with and without it.

    Attributes
    ----------
    has_ended : bool
        Whether the run has come to its end.
    first_speed : str
        The speed to begin with, one of ``SPEEDS``.
    """

    first_speed = FIRST_SPEED

    def __init__(
        self,
        server: "ViserServer",
        policy: Policy,
        name: str,
        clock: Callable[[], float] = time.monotonic,
        pace: Pace | None = None,
    ) -> None:
        self._server, self._policy, self._name, self._clock = server, policy, name, clock
        self._pace = pace or Pace()
        self.has_ended = False

    def begin(self, env: ExplorationEnv) -> None:
        """Lay out the page and draw the start; data of an earlier episode is dropped."""
        assert isinstance(env, WatchedExploration)
        assert env.floor is not None
        self._env, self.has_ended, self._decisions = env, False, 0
        self._frame_due = self._maps_due = 0.0
        self._followed: tuple[int, NDArray[np.float64]] | None = None
        self._server.scene.reset()
        self._server.gui.reset()
        has_cameras = env.simulation.camera is not None
        ceiling = min(env.floor.ceiling, 2.0 * CUT_M)
        self._controls = Controls(
            self._server,
            env.possible_agents,
            has_cameras,
            (ceiling, CUT_M if has_cameras else LOW_WALLS_M),
            self.first_speed,
            env.perception.predicts,
            self._add_controls,
        )
        self._maps = TeamMaps(env)
        self._scene = TeamScene(self._server, env, self._maps)
        self._draw_all()

    def step(self, env: ExplorationEnv, commands: NDArray[np.float64], /) -> None:
        """Draw if it is time to, and wait until the next step is due."""
        controls = self._controls
        self._draw_due()
        self._pace.wait(env.scorer.time, lambda: controls.speed, lambda: controls.is_paused, self._answer_controls)

    def decision(self, env: ExplorationEnv, orders: Orders | None, given_up: Sequence[GivenUp]) -> None:
        """Count a decision."""
        self._decisions += 1

    def outcome(self, env: ExplorationEnv) -> None:
        """Draw the end, if all robots have ended."""
        if not env.agents:
            self.has_ended = True
            self._controls.end()
            self._draw_all()

    def stay(self) -> None:
        """Keep answering the controls until ``KeyboardInterrupt``, as Ctrl-C and SIGTERM raise it."""
        while True:
            time.sleep(LONGEST_WAIT_S)
            self._answer_controls()

    def _answer_controls(self) -> bool:
        """Follow the controls; return whether the run should continue."""
        layers = self._controls.layers
        self._scene.cut_walls(self._controls.wall_height)
        self._scene.show(layers)
        if layers & OF_MAPS != self._drawn_layers:
            self._draw_maps()
        self._follow()
        return not is_end_asked()

    def _draw_due(self) -> None:
        now = self._clock()
        if now >= self._frame_due:
            self._frame_due = now + FRAME_S
            self._draw(moment_of(self._env))
            self._answer_controls()
        if now >= self._maps_due:
            self._draw_maps()

    def _draw_all(self) -> None:
        self._draw(moment_of(self._env))
        self._draw_maps()
        self._answer_controls()

    def _draw(self, moment: Moment) -> None:
        self._places = np.array([[*robot.pose[:2], 0.0] for robot in moment.robots])
        with self._server.atomic():
            self._scene.draw(moment)

    def _draw_maps(self) -> None:
        """Draw maps, frontiers and words; then not for so long that it takes a small share of the time."""
        began, env, report = self._clock(), self._env, self._policy.report()
        self._drawn_layers = self._controls.layers & OF_MAPS
        groups = self._shown_groups(joined_groups(report, env.possible_agents)[0])
        levels = self._maps.levels(env, groups)
        free = self._maps.free_beyond(env, groups) if Layer.PREDICTION in self._drawn_layers else None
        self._scene.draw_ground(self._maps.picture(groups, levels, free), self._maps.frontiers(levels))
        status = status_text(env, self._name, report, self._decisions, self._status())
        self._controls.write(status, events_text(env, report), env.scorer.coverage)
        if env.simulation.camera is not None:
            robot = self._controls.followed or 0
            sensor = env.simulation.camera
            self._controls.show_depth(false_colours(sensor.frames[robot], sensor.camera, DEPTH_SIZE))
        self._maps_due = self._clock() + max(MAPS_S, (self._clock() - began) / MAPS_SHARE)

    def _add_controls(self) -> None:
        """Add controls to the page, above the layers."""

    def _status(self) -> Sequence[tuple[str, str]]:
        """Return what else stands beside the progress: names and values."""
        return ()

    def _shown_groups(self, joined: list[set[int]]) -> list[set[int]]:
        """Return the robots whose maps are drawn as one: robots that know their starts need no station."""
        robots = range(self._env.settings.robots)
        groups = [set(robots)] if self._env.settings.known_starts else joined
        if Layer.JOINED not in self._drawn_layers:
            groups = [{robot} for robot in robots]
        is_wanted = {False: Layer.OWN in self._drawn_layers, True: Layer.JOINED in self._drawn_layers}
        return [group for group in groups if is_wanted[len(group) > 1]]

    def _follow(self) -> None:
        robot = self._controls.followed
        if robot is None:
            self._followed = None
            return
        here, followed = self._places[robot], self._followed
        is_same = followed is not None and followed[0] == robot
        before = followed[1] if followed is not None and is_same else None
        if before is None or not np.array_equal(here, before):
            follow(self._server, here, before)
        self._followed = robot, here
