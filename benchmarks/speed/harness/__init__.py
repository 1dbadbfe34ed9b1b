"""What all measurements of speed share: timing, lines, the report."""
