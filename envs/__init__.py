"""Worlds and environments: floors, simulation, onboard software, wrappers."""
