"""The engine: steps of many episodes, in arrays over rows = episodes x robots."""
