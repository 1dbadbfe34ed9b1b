"""Compiled functions: the decorator, their cache, views of arrays at addresses, work for threads."""
