"""What the robot does when anything fails: every fault as data, tried, and measured at the encoders."""
