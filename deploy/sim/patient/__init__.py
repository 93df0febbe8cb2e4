"""A soft patient in the simulated robot's way, and an operator without a suit who moves into him."""
