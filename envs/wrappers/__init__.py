"""Wrappers that change what a policy decides or sees."""
