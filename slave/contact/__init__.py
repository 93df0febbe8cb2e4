"""Whether something pushes the robot, by its motors' torques; and how it yields. See README.md."""
