"""The worlds of the thesis on the sensor-based random tree, driven again. They are compared with what was published."""
