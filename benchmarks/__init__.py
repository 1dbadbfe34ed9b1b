"""Speed and quality measured, one file per question; each runs alone."""
