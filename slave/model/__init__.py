"""The robot as a rigid-body model: built from its profile; servos, limits and contact read it."""
