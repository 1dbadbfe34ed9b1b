"""Finds how much two maps of one place are bent against each other."""
