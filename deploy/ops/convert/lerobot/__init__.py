"""A recording as a LeRobot dataset of version 3.0, written without the package `lerobot`."""
