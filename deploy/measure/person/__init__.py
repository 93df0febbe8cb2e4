"""Whether a worn suit's recording is that of a body: rates, axes, joints, symmetry, and which node is where."""
