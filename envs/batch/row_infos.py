"""What a batch says of its rows beside their observations."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.outcome.endings import REASONS
from lidarium.envs.radio.messages import OperatingState
from lidarium.envs.simulation.simulation import Simulation
from lidarium.envs.station.operating import state_after


def _frozen(array: NDArray[Any]) -> NDArray[Any]:
    """Return an array that cannot be written to any more."""
    array.flags.writeable = False
    return array


class RowInfos:
    """Puts together the infos of a step, in arrays over rows.

    What is said of all rows alike at most steps is one array that cannot be written to, not a new one each
    time.

    Parameters
    ----------
    simulation : Simulation
        Of all episodes.

    Attributes
    ----------
    everyone : (rows,) bool
        All true; cannot be written to.
    """

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation
        self._rows = simulation.robots * simulation.episodes
        self.everyone = _frozen(np.ones(self._rows, np.bool_))
        self._no_orders = _frozen(np.full(self._rows, "", object))
        camera = None if simulation.camera is None else simulation.camera.camera.calibration
        self._calibration = camera and {
            "intrinsics": {
                name: _frozen(np.full(self._rows, value)) for name, value in camera["intrinsics"].items()
            },
            "mount": _frozen(np.tile(camera["mount"], (self._rows, 1))),
        }
        self._states = _frozen(np.full(self._rows, OperatingState.OPERATING.value, object))

    def begin(self, rows: NDArray[np.bool_]) -> None:
        """Note that the robots of some rows (rows,) operate from now on."""
        self._note_states(rows, OperatingState.OPERATING.value)

    def of_step(
        self, terms: dict[str, NDArray[np.float64]], reasons: NDArray[np.int8], has_endings: bool
    ) -> dict[str, Any]:
        """Return the truth, states, terms of the reward and endings.

        Parameters
        ----------
        terms : dict of arrays
            What each term of the reward brought each row.
        reasons : (rows,) int8
            Why robots ended, by number in ``endings.REASONS``; 0 where they did not.
        has_endings : bool
            Whether any did.
        """
        everyone, score = self.everyone, self._simulation.score
        truth = {
            "pose": self._simulation.world.poses.copy(),
            "coverage": np.repeat(score.coverages(), self._simulation.robots),
            "seen_cells": score.seen.copy(),
        }
        # Nobody gives orders here: states follow from the endings alone.
        infos: dict[str, Any] = {
            "truth": truth,
            "_truth": everyone,
            "order": self._no_orders,
            "_order": everyone,
        }
        infos["reward_terms"], infos["_reward_terms"] = terms, everyone
        if has_endings:
            ended = reasons != 0
            names = np.full(self._rows, None, object)
            names[ended] = [REASONS[number] for number in reasons[ended]]
            infos["ended_because"], infos["_ended_because"] = names, ended
            self._note_states(ended, [state_after(name).value for name in names[ended]])
        infos["state"], infos["_state"] = self._states, everyone
        if self._calibration is not None:
            infos["camera"], infos["_camera"] = self._calibration, everyone
        return infos

    def _note_states(self, rows: NDArray[np.bool_], states: str | list[str]) -> None:
        """Note the operating states of some rows.

        Those that were handed out before stay as they are.
        """
        changed = self._states.copy()
        changed[rows] = states
        self._states = _frozen(changed)
