"""Driving of a robot to a target among other robots."""
