"""A robot's state for colleagues on ROS 2, one way only."""
