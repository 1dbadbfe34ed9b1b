"""Observations of a robot: the spaces, and the kernel that writes them.

The kernel writes the observations of all rows directly into the arrays of the caller.
"""

from collections.abc import Mapping
from operator import itemgetter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.observing.kernels import Arrays, write_parallel, write_serial
from lidarium.envs.observing.spaces import KEYS, boxes_of, observed_keys
from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.envs.simulation.simulation import ROWS_FOR_THREADS, Simulation
from lidarium.mapping.kernels.compilation import Array, available_threads, use_threads
from lidarium.mapping.kernels.views import table_of


class ObservationWriter:
    """Writes the observations of all rows of a world in one kernel call.

    It writes the observations chosen by the settings and nothing else.

    Parameters
    ----------
    simulation : Simulation
        Simulation of the robots.
    settings : ExplorationSettings
        Choice of observations; sizes, limits and threads.
    offsets : (rows, 2) float64
        Origin of each robot's map frame in the frame of its believed pose [m]; read at each call.
    goals : (rows, 2) float64 or None
        Each robot's goal in the frame of its believed pose [m], nan if it does not know one; read at each
        call. None if there are no goals, which are not observed then.

    Attributes
    ----------
    keys : tuple of str
        Names of the observations.

    Raises
    ------
    ValueError
        If the offsets or goals are of another type, or the world does not pool its maps at the scales that
        are observed.
    """

    def __init__(
        self,
        simulation: Simulation,
        settings: ExplorationSettings,
        offsets: NDArray[np.float64],
        goals: NDArray[np.float64] | None = None,
    ) -> None:
        self.keys = observed_keys(settings, goals is not None)
        self.rows = len(simulation.beliefs.believed)
        for name, array in (("offsets", offsets), ("goals", offsets if goals is None else goals)):
            if array.shape != (self.rows, 2) or array.dtype != np.float64 or not array.flags.c_contiguous:
                raise ValueError(f"{name} are {array.dtype} {array.shape}; want float64 {(self.rows, 2)}, contiguous")
        if "egocentric_map" in self.keys and simulation.beliefs.scales != settings.egocentric_scales:
            raise ValueError(
                f"the world pools its maps at scales {simulation.beliefs.scales}; want those of the "
                f"settings, {settings.egocentric_scales}"
            )
        kinds = {name: ((self.rows, *box.shape), box.dtype) for name, box in boxes_of(settings).items()}
        self._kinds = [kinds[name] for name in self.keys]
        self._sensed = [name for name in self.keys if name not in KEYS]
        missing = [name for name in self._sensed if name not in simulation.sensors]
        if missing:
            raise ValueError(f"the world has no sensor {missing[0]!r}; it has {', '.join(simulation.sensors)}")
        # The kernel takes the arrays of all keys, in order; those of keys that are not observed are empty.
        self._absent = {name: np.empty((0,) * len(shape), dtype) for name, (shape, dtype) in kinds.items()}
        self._in_order = itemgetter(*KEYS)
        # The space's bounds are float32, and so are those to which values are clipped.
        limits = [float(np.float32(limit)) for limit in settings.speed_limits.max(axis=0)]
        self._simulation = simulation
        self._arrays = (
            offsets,
            offsets if goals is None else goals,
            simulation.beliefs.pool_rows,
            np.array([settings.occupancy.resolution, *limits]),
            np.array(settings.egocentric_scales, np.int64),
        )
        self._sources: NDArray[np.int64] | None = None
        self._everyone = np.ones(self.rows, np.bool_)
        self._threads = min(settings.threads, available_threads()) if self.rows >= ROWS_FOR_THREADS else 1

    @property
    def kinds(self) -> dict[str, tuple[tuple[int, ...], Any]]:
        """Shape and dtype of the array of each key."""
        return dict(zip(self.keys, self._kinds, strict=True))

    def buffers(self) -> dict[str, NDArray[Any]]:
        """Return new arrays for the observations, by key.

        Their contents are undefined until they are written.
        """
        return {name: np.empty(*kind) for name, kind in zip(self.keys, self._kinds, strict=True)}

    def write(self, out: Mapping[str, NDArray[Any]], active: NDArray[np.bool_] | None = None) -> None:
        """Write one observation a row into arrays that ``buffers`` has made.

        Parameters
        ----------
        active : (rows,) bool or None
            Rows to write, the others keep their values; all by default.
        """
        sources, observed = self.arguments(out)
        active = self._everyone if active is None else active
        if self._threads > 1 and use_threads(self._threads) > 1:
            write_parallel(active, sources, observed)
        else:
            write_serial(active, sources, observed)
        if self._sensed:
            self.copy_sensors(out, active)

    def copy_sensors(self, out: Mapping[str, NDArray[Any]], active: NDArray[np.bool_]) -> None:
        """Write the observations that the kernel does not: last measurements of sensors, of the active rows."""
        for name in self._sensed:
            out[name][active] = self._simulation.sensors[name].reshape(out[name].shape)[active]

    def arguments(self, out: Mapping[str, NDArray[Any]]) -> tuple[Array, Arrays]:
        """Return the arguments of ``write_row`` except the row.

        These are the addresses of the sources, and of the output as ``buffers`` makes it.
        """
        sources = self._table() if self._sources is None else self._sources
        return sources, self._in_order({**self._absent, **out})

    def _table(self) -> NDArray[np.int64]:
        """Return the addresses of the sources of the observations.

        They are the world's table, offsets, goals, pooled maps, limits and scales.
        """
        self._sources = table_of((self._simulation.table, *self._arrays))
        return self._sources

    def __getstate__(self) -> dict[str, Any]:
        # A copy's arrays have other addresses, which are known when all of it has been made.
        return {**self.__dict__, "_sources": None}
