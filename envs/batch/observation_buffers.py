"""The arrays that hold the observations of all rows."""

from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from lidarium.envs.observations import ObservationWriter

Arrays = dict[str, NDArray[Any]]


class ObservationBuffers:
    """Arrays for the observations of a step; rows that are not seen repeat their last one.

    Parameters
    ----------
    writer : ObservationWriter
        What observations are written by.
    rows : int
        How many.
    boxes : dict
        Spaces of what is observed beside what the writer writes.
    copy : bool
        Whether there are new arrays at each step; otherwise two sets of arrays take turns.

    Attributes
    ----------
    latest : dict of arrays
        One observation a row, (rows, ...).
    """

    def __init__(
        self, writer: ObservationWriter, rows: int, boxes: dict[str, spaces.Space[Any]], copy: bool
    ) -> None:
        self._writer, self._rows, self._boxes, self._copy = writer, rows, boxes, copy
        self._pair = [self._new(), self._new()]
        self.latest = self._pair[0]

    def _new(self) -> Arrays:
        return {
            **self._writer.buffers(),
            **{
                name: np.zeros((self._rows, *(box.shape or ())), box.dtype)
                for name, box in self._boxes.items()
            },
        }

    def turn(self, seen: NDArray[np.bool_], is_same_step: bool) -> None:
        """Choose the arrays for the observations of this step.

        ``seen`` (rows,) says which are going to be written; where the step goes on with the one before, they
        are written over that one's.
        """
        before = self.latest
        if self._copy:
            self.latest = self._new()
        elif not is_same_step:
            self._pair.reverse()
            self.latest = self._pair[0]
        if self.latest is not before and not seen.all():
            for name, array in self.latest.items():
                array[~seen] = before[name][~seen]
