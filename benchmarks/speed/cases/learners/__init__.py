"""What those who train feel: threads at the level of frontiers, a trainer's steps, the first reset."""
