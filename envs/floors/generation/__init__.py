"""Floors generated from a seed."""
