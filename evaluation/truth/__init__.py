"""Ground truth of an episode: free and occupied cells, and the cells that robots have sensed and know."""
