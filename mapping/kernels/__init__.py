"""Compiled functions: their decorator, cache, views of arrays, work queue.

The decorator, the kernel cache, views of arrays at addresses, and work for threads.
"""

from typing import Any
