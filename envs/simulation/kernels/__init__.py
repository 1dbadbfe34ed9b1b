"""Kernels of a step: bodies move, lasers scan, masks fill, maps follow."""
