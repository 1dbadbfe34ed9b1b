"""The worlds of the thesis on the sensor-based random tree, driven again and compared with what was published."""
