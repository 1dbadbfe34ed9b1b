"""The experiments of supervised teams: what is run, the figures of runs, and the tables of the page."""
