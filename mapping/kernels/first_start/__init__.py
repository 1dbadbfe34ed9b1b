"""Kernels compiled side by side where a first start has none."""
