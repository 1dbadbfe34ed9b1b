"""What an action is: a command, a waypoint, a frontier."""
