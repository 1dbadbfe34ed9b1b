"""Learning from episodes that are run again with one decision changed."""
