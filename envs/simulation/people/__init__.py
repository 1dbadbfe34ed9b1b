"""People who walk on a floor, and its doors."""
