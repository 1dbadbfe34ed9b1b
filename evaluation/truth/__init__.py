"""What is true of a floor, for the figures of a run."""

from typing import Any
