"""Drives a robot by hand on the page of a run: keys, buttons, or a click on the floor."""

import math
import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from lidarium.agents.policy import Action, Policy
from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.onboard.radio.messages import Stop, Target
from lidarium.evaluation.viewing.live_view import LiveView, Pace
from lidarium.evaluation.viewing.moment import from_floor

if TYPE_CHECKING:
    from viser import ViserServer

FORWARD, BACK, LEFT, RIGHT, HALT = "Forward (W)", "Back (S)", "Left (A)", "Right (D)", "Stop (Space)"

KEYS: dict[str, tuple[str, ...]] = {
    FORWARD: ("W", "arrowup"),
    LEFT: ("A", "arrowleft"),
    RIGHT: ("D", "arrowright"),
    BACK: ("S", "arrowdown"),
    HALT: ("space",),
}
"""Keys by what they do. As with other programs of teleoperation, a robot goes on until it is told otherwise."""

BACKWARD, TURN = 0.5, 0.5
"""Shares of the limits at which a robot backs and turns."""

Times = Sequence[tuple[float, float]]
"""Times [s] and coverage, in order."""


class Hand:
    """What a person wants of a robot; calling it returns the action for this step."""

    def __init__(self) -> None:
        self._speed = self._turn = 0.0
        self._target: Target | None = None
        self._has_ended = False

    def press(self, what: str) -> None:
        """Take in a key or button: one of `KEYS`. A goal is given up."""
        self._target = None
        if what in (LEFT, RIGHT):
            self._turn = TURN if what == LEFT else -TURN
        else:
            self._speed, self._turn = {FORWARD: 1.0, BACK: -BACKWARD, HALT: 0.0}[what], 0.0

    def go_to(self, x: float, y: float) -> None:
        """Drive to a point of the robot's map [m]."""
        self.press(HALT)
        self._target = Target(x, y)

    def end(self) -> None:
        """End the robot's part in the run."""
        self._has_ended = True

    def __call__(self) -> Action:
        """Return the action for this step."""
        if self._has_ended:
            return Stop("ended by hand")
        return self._target or np.array([self._speed, self._turn], np.float32)


def _press(hand: Hand, what: str, _event: object) -> None:
    hand.press(what)


class DrivenView(LiveView):
    """A page of a run one of whose robots a person drives.

    Parameters
    ----------
    hand : Hand
        Takes in what the person does.
    row : int
        The person's robot.
    beside : (str, sequence), optional
        Name, and times and coverage of a policy in the same place; its coverage stands beside the person's.
    """

    first_speed = "1 x"

    def __init__(
        self,
        server: "ViserServer",
        policy: Policy,
        name: str,
        hand: Hand,
        row: int = 0,
        beside: tuple[str, Times] | None = None,
        clock: Callable[[], float] = time.monotonic,
        pace: Pace | None = None,
    ) -> None:
        super().__init__(server, policy, name, clock, pace)
        self._hand, self._row, self._beside = hand, row, beside

    def begin(self, env: ExplorationEnv) -> None:
        """Lay out the page; a click on the floor is a goal."""
        super().begin(env)
        self._server.scene.on_click()(lambda event: self._click(event.ray_origin, event.ray_direction))

    def _add_controls(self) -> None:
        server, hand = self._server, self._hand
        with server.gui.add_folder(f"Drive {self._env.possible_agents[self._row]}: keys, or a click on the floor"):
            for what, keys in KEYS.items():
                pressed: Any = partial(_press, hand, what)
                server.gui.add_button(what).on_click(pressed)
                for key in keys:
                    command: Any = server.gui.add_command(f"{what}: {key}", hotkey=key)  # type: ignore[arg-type]
                    command.on_trigger(pressed)
            server.gui.add_button("End its work").on_click(lambda _: hand.end())

    def _click(self, origin: Sequence[float], direction: Sequence[float]) -> None:
        """Drive to where a ray meets the ground, if it does within the floor."""
        if direction[2] >= 0.0 or self._env.floor is None:
            return
        reach = -origin[2] / direction[2]
        point = np.array([origin[0] + reach * direction[0], origin[1] + reach * direction[1]])
        x, y = from_floor(self._env, self._row, point)
        if math.isfinite(x) and math.isfinite(y):
            self._hand.go_to(float(x), float(y))

    def _status(self) -> list[tuple[str, str]]:
        """Return the coverage that the other policy had by now."""
        if self._beside is None:
            return []
        name, times = self._beside
        now = self._env.scorer.time + 1e-9
        share = max((coverage for time_s, coverage in times if time_s <= now), default=0.0)
        return [(name, f"{100.0 * share:.1f} %")]
