"""Localizers on odometry with scans, all behind one protocol.

They estimate the robots' poses.
"""
