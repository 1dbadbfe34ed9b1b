"""Pictures of runs, maps, merges, reports."""
