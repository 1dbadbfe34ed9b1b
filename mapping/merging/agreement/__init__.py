"""Whether two maps agree under a motion, by what their cells say."""
