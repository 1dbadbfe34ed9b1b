"""What a team has covered of a floor."""
