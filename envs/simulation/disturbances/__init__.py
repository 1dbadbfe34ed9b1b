"""What makes a world real: noise, odometry, faults, radio links."""
