"""What the lines of CARMEN logs say."""
