"""Rigid transforms of the plane."""
