"""The kinematic world: bodies that follow commands, scans cast by kernels."""
