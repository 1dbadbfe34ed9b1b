"""The study of spline maps on worlds with a goal, then of localizers on them in buildings."""
