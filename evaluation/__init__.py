"""Episodes run, measured, recorded, reported."""
