"""A client of PyBullet: one physics server, closed when its last user releases it."""

import importlib
import os
import sys
import tempfile
import weakref
from pathlib import Path
from typing import Any

from lidarium.extras import install_command


class _MissingBulletError(ImportError, ValueError):
    """PyBullet is not installed, so that the backend cannot be chosen."""


def _load_bullet() -> Any:  # noqa: ANN401
    """Return the module ``pybullet``."""
    try:
        return importlib.import_module("pybullet")
    except ImportError as error:
        command = install_command("bullet")
        raise _MissingBulletError(
            f'backend "bullet" needs PyBullet, whose wheels end at CPython 3.11: {command}'
        ) from error


def has_display() -> bool:
    """Whether there is a display for a window; without one PyBullet would end the process."""
    return not sys.platform.startswith("linux") or bool(os.environ.get("DISPLAY"))


class Client:
    """A physics server in this process.

    Its calls are those of ``pybullet``, each with the number of the server.

    Parameters
    ----------
    is_shown : bool
        Whether it has a window.

    Raises
    ------
    _MissingBulletError
        If PyBullet is not installed.
    """

    def __init__(self, is_shown: bool = False) -> None:
        self.bullet = _load_bullet()
        self._number = self.bullet.connect(self.bullet.GUI if is_shown else self.bullet.DIRECT)
        if is_shown:
            self.call("configureDebugVisualizer", self.bullet.COV_ENABLE_GUI, 0)
        if self._number < 0:
            raise RuntimeError("PyBullet has no free client; close environments that are not used any more")
        self._finalizer = weakref.finalize(self, self.bullet.disconnect, self._number)

    @property
    def is_open(self) -> bool:
        """Whether the server runs."""
        return self._finalizer.alive

    def call(self, name: str, *arguments: Any, **options: Any) -> Any:  # noqa: ANN401
        """Call a function of PyBullet on this server."""
        return getattr(self.bullet, name)(*arguments, **options, physicsClientId=self._number)

    def load_text(self, text: str, **options: Any) -> int:  # noqa: ANN401
        """Load a body of the text of a URDF file, and return its number."""
        with tempfile.TemporaryDirectory(prefix="lidarium_") as folder:
            path = Path(folder) / "body.urdf"
            path.write_text(text)
            return int(self.call("loadURDF", str(path), **options))

    def load_pieces(self, text: str) -> int:
        """Load a static body of the text of an OBJ file, whose objects are convex; return its number."""
        with tempfile.TemporaryDirectory(prefix="lidarium_") as folder:
            path = Path(folder) / "body.obj"
            path.write_text(text)
            shape = self.call("createCollisionShape", self.bullet.GEOM_MESH, fileName=str(path))
            return int(self.call("createMultiBody", 0.0, shape))

    def close(self) -> None:
        """End the server; closing again does nothing."""
        self._finalizer()
