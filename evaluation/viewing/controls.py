"""The controls of a page: pause, speed, whom to follow, layers, and text."""

import math
from collections.abc import Callable, Sequence
from enum import Enum
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from viser import GuiInputHandle, ViserServer

    from lidarium.envs.drawing.frame_parts import Frame


class Layer(Enum):
    """Layers that can be shown; the value is the label."""

    FLOOR = "True walls"
    JOINED = "Joined map"
    OWN = "Own maps"
    ROBOTS = "Robots"
    BELIEVED = "Believed poses"
    SCANS = "Scans"
    TRAILS = "Paths driven"
    PLANS = "Plans and goals"
    FRONTIERS = "Frontiers"
    PREDICTION = "Prediction"
    CLOUDS = "Depth images"
    BOXES = "Sparse maps"


OF_MAPS = frozenset({Layer.JOINED, Layer.OWN, Layer.PREDICTION})
"""Layers that the picture of the ground shows."""

OF_CAMERAS = (Layer.CLOUDS, Layer.BOXES)
"""Layers that are there only if robots have cameras."""

SPEEDS = {"1 x": 1.0, "2 x": 2.0, "5 x": 5.0, "10 x": 10.0, "20 x": 20.0, "As fast as it goes": math.inf}
"""Simulated seconds per second by label."""

FIRST_SPEED = "5 x"

NOBODY = "The whole floor"

BEHIND = 0.0, -4.5, 6.0
"""Position of the camera relative to a robot when it begins to follow it [m]."""

PAUSE, RESUME = "Pause", "Resume"


class Controls:
    """Controls at the side of a page; they have the last choice in any browser.

    Parameters
    ----------
    heights : (float, float)
        Greatest height at which walls can be cut, and the one to begin with [m].
    speed : str
        The speed to begin with.
    predicts : bool
        Whether the prediction is shown at first.
    more : callable, optional
        Adds controls of its own, above the layers.
    """

    def __init__(
        self,
        server: "ViserServer",
        agents: Sequence[str],
        has_cameras: bool,
        heights: tuple[float, float],
        speed: str = FIRST_SPEED,
        predicts: bool = False,
        more: Callable[[], None] = lambda: None,
    ) -> None:
        gui = server.gui
        gui.configure_theme(show_logo=False, show_share_button=False)  # sharing would need the network
        self._text = gui.add_html("")
        self._coverage: Any = gui.add_progress_bar(0.0, color="green")
        self._pause = gui.add_button(PAUSE)
        self._is_paused = False
        self._pause.on_click(lambda _: self._turn_pause())
        self._speed = gui.add_dropdown("Speed", tuple(SPEEDS), initial_value=speed)
        self._follow = gui.add_dropdown("Follow", (NOBODY, *agents))
        self._agents = list(agents)
        more()
        with gui.add_folder("Layers"):
            self._layers: dict[Layer, GuiInputHandle[bool]] = {
                layer: gui.add_checkbox(layer.value, predicts or layer is not Layer.PREDICTION)
                for layer in Layer
                if has_cameras or layer not in OF_CAMERAS
            }
            greatest, first = heights
            self._height = gui.add_slider("Walls cut [m]", 0.05, max(greatest, 0.1), 0.05, min(first, greatest))
        with gui.add_folder("What happened"):
            self._events = gui.add_html("")
        self._depth = gui.add_image(np.zeros((2, 2, 3), np.uint8), label="Depth image", visible=has_cameras)

    def _turn_pause(self) -> None:
        self._is_paused = not self._is_paused
        self._pause.label = RESUME if self._is_paused else PAUSE

    @property
    def is_paused(self) -> bool:
        """Whether the run waits."""
        return self._is_paused

    @property
    def speed(self) -> float:
        """Simulated seconds per second, above 0; inf for the maximum speed."""
        return SPEEDS[str(self._speed.value)]

    @property
    def followed(self) -> int | None:
        """Number of the robot that is followed; None for none."""
        chosen = str(self._follow.value)
        return None if chosen == NOBODY else self._agents.index(chosen)

    @property
    def layers(self) -> frozenset[Layer]:
        """Layers that are shown."""
        return frozenset(layer for layer, box in self._layers.items() if box.value)

    @property
    def wall_height(self) -> float:
        """Height at which walls are cut [m]."""
        return float(self._height.value)

    def write(self, status: str, events: str, coverage: float) -> None:
        """Show progress and events (HTML), and a share of the floor as a bar."""
        self._text.content, self._events.content = status, events
        self._coverage.value = 100.0 * min(coverage, 1.0)

    def show_depth(self, picture: "Frame") -> None:
        """Show a depth image."""
        self._depth.image = picture

    def end(self) -> None:
        """Show that the run is over: there is nothing to pause any more."""
        self._is_paused = False
        self._pause.label, self._pause.disabled, self._speed.disabled = "The run is over", True, True


def follow(server: "ViserServer", here: NDArray[np.float64], before: NDArray[np.float64] | None) -> None:
    """Move the cameras of all browsers with a robot that was at ``before`` (3,) and is ``here`` [m].

    A camera that begins to follow looks at it from behind and above.
    """
    for client in server.get_clients().values():
        if before is None:
            client.camera.position = here + np.array(BEHIND)
            client.camera.look_at = here
        else:
            client.camera.position = client.camera.position + (here - before)
