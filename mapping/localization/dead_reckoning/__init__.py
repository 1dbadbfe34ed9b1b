"""Poses from odometry alone."""
