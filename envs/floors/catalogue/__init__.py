"""Floors by name."""

from typing import Any
