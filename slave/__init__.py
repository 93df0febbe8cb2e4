"""The robot's side: joint commands in, guarded servo motion and encoder readings out."""
