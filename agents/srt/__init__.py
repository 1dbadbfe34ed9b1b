"""The sensor-based random tree: an explorer that grows a tree of places with the safe region that was seen from each."""
