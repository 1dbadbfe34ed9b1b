"""Bags of ROS 2: MCAP files, read without ROS."""
