"""Files of maps, logs, trajectories."""
