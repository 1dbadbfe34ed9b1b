"""Frames of a bag: where a laser is mounted on its robot, by a chain of transforms in space."""

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.files.guarded_reading import printable

_MAX_LEAN = math.radians(5.0)
"""A laser that leans by more measures no floor plan: its beams end on the floor or above walls."""

_MAX_SHIFT_M, _MAX_SWAY = 0.05, math.radians(3.0)
"""A laser that moves by more on its robot is not mounted [m, rad]."""


class Mounting(NamedTuple):
    """Where a laser is on its robot.

    Attributes
    ----------
    pose : (3,) float64
        x, y, theta [m, rad].
    is_hanging : bool
        Whether it hangs upside down, so that its beams run clockwise.
    """

    pose: NDArray[np.float64]
    is_hanging: bool


@dataclass(slots=True, eq=False)
class _Link:
    """The pose of a frame in its parent, (4, 4), as first told, and by how much later ones differ [m, rad]."""

    parent: str
    pose: NDArray[np.float64]
    is_static: bool
    shift_m: float = 0.0
    sway: float = 0.0


class Frames:
    """Frames, each with its pose in its parent."""

    def __init__(self) -> None:
        self._links: dict[str, _Link] = {}

    def note(self, parent: str, child: str, transform: Any, *, is_static: bool) -> None:  # noqa: ANN401
        """Take in a transform as ROS has it: a translation and a quaternion."""
        if child == parent:
            return
        known = self._links.get(child)
        if known is None or (is_static and not known.is_static):
            self._links[child] = _Link(parent, _matrix(transform), is_static)
        elif not known.is_static and known.parent == parent:
            apart = np.linalg.inv(known.pose) @ _matrix(transform)
            known.shift_m = max(known.shift_m, float(np.linalg.norm(apart[:3, 3])))
            known.sway = max(known.sway, math.acos(min(max(0.5 * (np.trace(apart[:3, :3]) - 1.0), -1.0), 1.0)))

    def body(self, frame: str) -> str:
        """Return the frame to which a frame is fixed at last: that of the robot's body, if all is told."""
        return next(name for name in reversed(self._above(frame)) if self._is_fixed(frame, name))

    def is_connected(self, base: str, laser: str) -> bool:
        """Whether a chain of transforms that does not pass odometry leads from a frame to another."""
        joint = self._joint(base, laser)
        return joint is not None and not joint.endswith("odom")

    def _joint(self, base: str, laser: str) -> str | None:
        above = self._above(laser)
        return next((name for name in self._above(base) if name in above), None)

    def mounting(self, base: str, laser: str) -> Mounting | None:
        """Return where a laser is on a robot's body; None if no chain of transforms leads there.

        Raises ValueError if the laser moves on the body, or leans.
        """
        up, down, joint = self._above(base), self._above(laser), self._joint(base, laser)
        if joint is None or not self.is_connected(base, laser):
            return None
        to_base, to_laser = self._chained(up[: up.index(joint)]), self._chained(down[: down.index(joint)])
        pose = np.linalg.inv(to_base) @ to_laser
        for name in (*up[: up.index(joint)], *down[: down.index(joint)]):
            link = self._links[name]
            if link.shift_m > _MAX_SHIFT_M or link.sway > _MAX_SWAY:
                raise ValueError(
                    f"the laser moves on the robot: frame {printable(name)} moves in {printable(link.parent)} by "
                    f"{link.shift_m:.2f} m, {math.degrees(link.sway):.0f} degrees; want a laser that is fixed"
                )
        lean = math.acos(min(abs(float(pose[2, 2])), 1.0))
        if lean > _MAX_LEAN:
            raise ValueError(
                f"the laser (frame {printable(laser)}) leans by {math.degrees(lean):.0f} degrees on the robot; want "
                f"one that is level within {math.degrees(_MAX_LEAN):.0f} degrees"
            )
        theta = math.atan2(float(pose[1, 0]), float(pose[0, 0]))
        return Mounting(np.array([pose[0, 3], pose[1, 3], theta]), bool(pose[2, 2] < 0.0))

    def _above(self, frame: str) -> list[str]:
        """Return a frame, its parent, and so on."""
        names = [frame]
        while names[-1] in self._links and self._links[names[-1]].parent not in names:
            names.append(self._links[names[-1]].parent)
        return names

    def _is_fixed(self, frame: str, above: str) -> bool:
        names = self._above(frame)
        return all(self._links[name].is_static for name in names[: names.index(above)])

    def _chained(self, names: list[str]) -> NDArray[np.float64]:
        """Return the pose, (4, 4), of the first of some frames in the parent of the last."""
        pose = np.eye(4)
        for name in names:
            pose = self._links[name].pose @ pose
        return pose


def _matrix(transform: Any) -> NDArray[np.float64]:  # noqa: ANN401
    """Return a transform as a matrix (4, 4); a quaternion of zeros is no turn."""
    place, turn = transform.translation, transform.rotation
    x, y, z, w = quaternion = np.array([turn.x, turn.y, turn.z, turn.w], np.float64)
    square = float(quaternion @ quaternion)
    pose = np.eye(4)
    pose[:3, 3] = place.x, place.y, place.z
    if square > 0.0:
        with np.errstate(over="ignore", invalid="ignore"):
            pose[:3, :3] += (2.0 / square) * np.array(
                [
                    [-y * y - z * z, x * y - z * w, x * z + y * w],
                    [x * y + z * w, -x * x - z * z, y * z - x * w],
                    [x * z - y * w, y * z + x * w, -x * x - y * y],
                ]
            )
    if not np.isfinite(pose).all():
        raise ValueError("a transform between frames is not finite; want metres and a quaternion")
    return pose
