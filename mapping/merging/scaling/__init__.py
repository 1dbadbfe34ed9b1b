"""Joins two maps of which the scale of one is not known, such as a drawn plan."""
