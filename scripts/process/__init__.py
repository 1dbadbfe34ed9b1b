"""Signals that a command's process hears, with the streams that it tells on."""
