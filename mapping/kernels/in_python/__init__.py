"""Kernels in plain Python, where numba compiles nothing."""
