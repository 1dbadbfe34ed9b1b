"""Planes of a team's map, for tests of its changes."""

import numpy as np

FAR = 1e3


def records_of(maps):
    return np.array([(log_odds.ctypes.data, *log_odds.shape) for log_odds in maps], np.int64)


def blank_planes(rows, words):
    return (
        np.zeros((rows, words), np.uint64),
        np.zeros((rows, words), np.uint64),
        np.empty((rows * words, 3), np.uint64),
    )


def levels_of_sum(total):
    return np.where(total < 0, 255, np.where(total > 0, 0, 127)).astype(np.uint8)
