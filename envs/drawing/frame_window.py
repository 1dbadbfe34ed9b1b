"""A window that shows frames."""

import warnings
from typing import Any

from lidarium.envs.drawing.frame_parts import Frame


class FrameWindow:
    """A window that shows frames.

    Without a display it prints a message once and does nothing.

    Parameters
    ----------
    title : str
        Title of the window.
    """

    def __init__(self, title: str) -> None:
        self._title = title
        self._figure: Any = None
        self._image: Any = None
        self._is_off = False

    def show(self, frame: Frame) -> None:
        """Show a frame; opens the window with the first one.

        A window that the user has closed stays closed.
        """
        if self._is_off:
            return
        from matplotlib import pyplot

        if self._figure is None:
            self._open(frame)
            if self._figure is None:
                return
        elif not pyplot.fignum_exists(self._figure.number):
            self._is_off = True
            return
        if self._image.get_array().shape != frame.shape:
            self._image.set_extent((-0.5, frame.shape[1] - 0.5, frame.shape[0] - 0.5, -0.5))
        self._image.set_data(frame)
        self._figure.canvas.draw_idle()
        self._figure.canvas.flush_events()

    def close(self) -> None:
        """Close the window, if there is one; closing again does nothing."""
        if self._figure is not None:
            from matplotlib import pyplot

            pyplot.close(self._figure)
            self._figure = self._image = None

    def _open(self, frame: Frame) -> None:
        from matplotlib import pyplot

        figure = None
        try:
            # Making a figure settles which backend there is; each toolkit has an error of its own for want of
            # a display.
            figure = pyplot.figure(self._title, figsize=(frame.shape[1] / 100.0, frame.shape[0] / 100.0), dpi=100)
            has_display = figure.canvas.required_interactive_framework is not None
        except Exception:
            has_display = False
        if not has_display or figure is None:
            if figure is not None:
                pyplot.close(figure)
            self._is_off = True
            warnings.warn(
                "render_mode is 'human', but there is no display to open a window on; nothing is shown (use "
                "'rgb_array' for frames)",
                UserWarning,
                stacklevel=4,
            )
            return
        axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
        axes.set_axis_off()
        self._image = axes.imshow(frame, interpolation="antialiased")
        self._figure = figure
        pyplot.show(block=False)
