"""Ground truth of an episode: free and occupied cells, who sensed and knows them."""
