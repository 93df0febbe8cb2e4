"""A bus of X series servos that are not there, behind a pseudo-terminal."""
