"""Localizers on maps of B-splines."""
