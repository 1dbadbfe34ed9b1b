"""One episode: how it is run, watched, stopped, scored."""
