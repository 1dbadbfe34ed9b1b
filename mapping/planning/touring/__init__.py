"""Tours past places of a map, of one robot or of a team."""
