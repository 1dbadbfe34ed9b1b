"""Benchmarks: named tasks whose floors, starts, settings and rules never change.

The rows of reference policies come with them.
"""
