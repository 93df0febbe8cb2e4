"""What the viewers of the field read: the robot as URDF, its frames, and messages in Foxglove's schemas."""
