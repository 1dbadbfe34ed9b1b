"""Observations of a robot: the spaces, and the kernel that writes them.

The kernel writes the observations of all rows directly into the arrays of the caller.
"""

from collections.abc import Mapping
from itertools import starmap
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
        self._sensed = [(place, name) for place, name in enumerate(self.keys) if name not in KEYS]
        missing = [name for _, name in self._sensed if name not in simulation.sensors]
        if missing:
            raise ValueError(f"the world has no sensor {missing[0]!r}; it has {', '.join(simulation.sensors)}")
        # The kernel takes the arrays of all its keys, in order; keys that are not observed come last.
        absent = [name for name in KEYS if name not in self.keys]
        self._absent = [np.empty((0,) * len(kinds[name][0]), kinds[name][1]) for name in absent]
        self._in_order = itemgetter(*((*self.keys, *absent).index(name) for name in KEYS))
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

    def write(
        self, out: Mapping[str, NDArray[Any]] | None = None, active: NDArray[np.bool_] | None = None
    ) -> Mapping[str, NDArray[Any]]:
        """Write one observation a row.

        Parameters
        ----------
        active : (rows,) bool or None
            Rows to write, the others keep their values; all by default.
        """
        arrays = list(starmap(np.empty, self._kinds)) if out is None else self.check(out)
        self._write(arrays, active)
        return dict(zip(self.keys, arrays, strict=True)) if out is None else out

    def fill(self, out: Mapping[str, NDArray[Any]], active: NDArray[np.bool_] | None = None) -> None:
        """Write into arrays that ``buffers`` has made, without checks; see `write`."""
        arrays = [out[name] for name in self.keys]
        self._write(arrays, active)

    def _write(self, arrays: list[NDArray[Any]], active: NDArray[np.bool_] | None) -> None:
        sources = self._table() if self._sources is None else self._sources
        chosen, observed = self._everyone if active is None else active, self._in_order(arrays + self._absent)
        if self._threads > 1 and use_threads(self._threads) > 1:
            write_parallel(chosen, sources, observed)
        else:
            write_serial(chosen, sources, observed)
        if self._sensed:
            self._copy_sensors(arrays, active)

    def copy_sensors(self, out: Mapping[str, NDArray[Any]], active: NDArray[np.bool_]) -> None:
        """Write the observations that the kernel does not: last measurements of sensors, of the active rows."""
        if self._sensed:
            self._copy_sensors([out[name] for name in self.keys], active)

    def _copy_sensors(self, arrays: list[NDArray[Any]], active: NDArray[np.bool_] | None) -> None:
        for place, name in self._sensed:
            measured = self._simulation.sensors[name].reshape(arrays[place].shape)
            if active is None:
                arrays[place][:] = measured
            else:
                arrays[place][active] = measured[active]

    def arguments(self, out: Mapping[str, NDArray[Any]]) -> tuple[Array, Arrays]:
        """Return the arguments of ``write_row`` except the row.

        These are the addresses of the sources, and of the output as ``buffers`` makes it.
        """
        sources = self._table() if self._sources is None else self._sources
        return sources, self._in_order([out[name] for name in self.keys] + self._absent)

    def _table(self) -> NDArray[np.int64]:
        """Return the addresses of the sources of the observations.

        They are the world's table, offsets, goals, pooled maps, limits and scales.
        """
        self._sources = table_of((self._simulation.table, *self._arrays))
        return self._sources

    def __getstate__(self) -> dict[str, Any]:
        # A copy's arrays have other addresses, which are known when all of it has been made.
        return {**self.__dict__, "_sources": None}

    def check(self, out: Mapping[str, NDArray[Any]]) -> list[NDArray[Any]]:
        """Check arrays that a caller gives, and return them in the order of the keys."""
        arrays = []
        for name, (shape, dtype) in zip(self.keys, self._kinds, strict=True):
            array = out.get(name)
            if array is None:
                raise ValueError(f"out has no array for {name}; want {', '.join(self.keys)}")
            if array.shape != shape or array.dtype != dtype or not array.flags.carray:
                raise ValueError(
                    f"the array for {name} is {array.dtype} {array.shape}; want {dtype} {shape}, contiguous "
                    "and writeable"
                )
            arrays.append(array)
        return arrays
