"""The measurements of speed, one module each."""
