"""Policies: they only decide."""
