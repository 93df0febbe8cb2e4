"""What a recording holds: read back, counted, and computed again."""
