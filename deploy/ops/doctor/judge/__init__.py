"""What that means for a role, and what to do about it. Pure."""
