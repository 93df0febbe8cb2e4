"""A node taped to the hand of a slave's simulated robot: a process of its own on the suit's bus."""
