"""The experiments of supervised teams. They are what is run, the figures of runs, and the tables of the report."""
