"""`tandem prove`: what a node on the robot's hand saw, beside what the stamps claim."""
