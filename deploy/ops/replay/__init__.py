"""A recording of a master computed again, and how the joint angles compare."""
