"""Whether a worn suit's recording is a body's: rates, axes, joints, symmetry, and which node is where."""
