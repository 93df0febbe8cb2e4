"""`tandem contact`: the robot meets a soft patient, and follows through the air without a false stop."""
