"""What went into the master's pipeline, kept so exactly that the joint angles can be computed again."""
