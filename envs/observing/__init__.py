"""Observables that are plain functions of named arrays."""
