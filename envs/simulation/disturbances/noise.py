"""Noise from a counter: one draw for each (key, robot, step, beam).

It does not depend on the order of threads or rows.

A 32-bit hash of the counter picks one entry from each of two tables; the sum of the two entries is Gaussian.
"""

from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.kernels.compilation import Array, kernel

TABLE_SIZE = 4096


def _half_variance_table() -> NDArray[np.float32]:
    """Quantiles of a Gaussian of variance 1/2, scaled to have that variance exactly."""
    quantiles = np.array([NormalDist().inv_cdf((k + 0.5) / TABLE_SIZE) for k in range(TABLE_SIZE)])
    return np.asarray(quantiles * np.sqrt(0.5 / np.mean(quantiles**2)), np.float32)


GAUSSIAN_TABLE = _half_variance_table()


@kernel(forceinline=True)
def mix(value: np.uint32) -> np.uint32:
    """Scramble 32 bits (finaliser of MurmurHash3, by A. Appleby, public domain)."""
    value = np.uint32(value)
    value ^= value >> np.uint32(16)
    value = np.uint32(value * np.uint32(0x85EBCA6B))
    value ^= value >> np.uint32(13)
    value = np.uint32(value * np.uint32(0xC2B2AE35))
    value ^= value >> np.uint32(16)
    return value


@kernel(forceinline=True)
def stream_key(seed: int, robot: int, step: int) -> np.uint32:
    """Key of one robot's draws in one step, from a 64-bit seed."""
    low = np.uint32(seed & np.uint64(0xFFFFFFFF))
    high = np.uint32(seed >> np.uint64(32))
    key = mix(low ^ np.uint32(0x9E3779B9))
    key = mix(key ^ high)
    key = mix(key ^ np.uint32(robot))
    return np.uint32(mix(key ^ np.uint32(step & 0xFFFFFFFF)))  # a step may be -1


@kernel(forceinline=True, nrt=False)
def gaussian_at(key: np.uint32, table: Array, k: int) -> np.float32:
    """Draw number ``k`` of the stream ``key``, a standard Gaussian."""
    bits = mix(np.uint32(key + np.uint32(np.uint32(k) * np.uint32(0x9E3779B9))))
    return np.float32(table[bits & np.uint32(4095)] + table[(bits >> np.uint32(12)) & np.uint32(4095)])


@kernel(nrt=False)
def fill_gaussian(key: np.uint32, table: Array, values: Array) -> None:
    """Fill ``values`` (count,) float32 with standard Gaussian draws.

    They come from the stream ``key``.
    """
    for k in range(values.shape[0]):
        values[k] = gaussian_at(key, table, k)
