"""Short tones that tell the operator what the robot does: when each is due, its sound, and the sound card."""
