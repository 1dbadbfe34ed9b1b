"""Vector operations run as Python runs them and as kernels do, on copies of the same arrays."""

import functools

import numba
import numpy as np


@functools.cache
def _compiled(operation):
    return numba.njit(lambda arguments: operation(*arguments), error_model="numpy")


def assert_forms_agree(operation, *arguments):
    """Assert that definition and vector text return and write the same; return that.

    Arrays, and pairs of an array and an offset in bytes, are passed by their addresses.
    """
    results = []
    for function in (lambda given: operation(*given), _compiled(operation)):
        given, arrays = [], []
        for argument in arguments:
            array, offset = argument if isinstance(argument, list) else (argument, 0)
            if isinstance(array, np.ndarray):
                arrays.append(array.copy())
                given.append(arrays[-1].ctypes.data + offset)
            else:
                given.append(argument)
        with np.errstate(all="ignore"):
            results.append((function(tuple(given)), *arrays))
    defined, compiled = results
    for expected, found in zip(defined, compiled, strict=True):
        np.testing.assert_array_equal(found, expected, strict=isinstance(found, np.ndarray))
    return defined
