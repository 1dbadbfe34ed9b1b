"""Localizers on odometry and scans, all behind one protocol.

They estimate the robots' poses.
"""
