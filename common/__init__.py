"""What the master and the slave share; it imports neither."""
