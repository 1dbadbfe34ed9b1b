"""How soon a team that knew a floor could have seen it."""
