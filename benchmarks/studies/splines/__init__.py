"""The study of spline maps: on worlds with a goal, and in buildings."""
