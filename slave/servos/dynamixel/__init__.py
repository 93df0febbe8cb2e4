"""Serial-bus servos of the DYNAMIXEL X series: protocol 2.0, 4096 positions a turn."""
