"""`tandem voice`: the operator and the person at the robot talk. A process of its own on each side."""
