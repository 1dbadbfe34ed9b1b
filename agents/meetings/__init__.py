"""Explorers that agree on meetings, so that all robots know the floor although their radio breaks."""
