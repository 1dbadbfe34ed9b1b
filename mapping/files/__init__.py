"""Files of maps, logs, trajectories."""

from typing import Any
