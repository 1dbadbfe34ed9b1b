"""Commands about what a team that knew the floor could do."""
