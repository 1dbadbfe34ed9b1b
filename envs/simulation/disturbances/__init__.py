"""Disturbances of the world: noise, odometry errors, faults, radio links."""
