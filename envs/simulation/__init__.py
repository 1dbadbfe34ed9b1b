"""The simulation of a team: a world of bodies with sensors, beliefs of robots, the score."""
