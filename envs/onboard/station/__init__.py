"""The station of a team: operating states, reports, the map of the team."""
