"""Simultaneous localization with a graph of submaps."""

from typing import Any
