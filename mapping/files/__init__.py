"""Files of maps, logs, trajectories and bags."""
