"""What the page shows, from messages and the time alone. Pure."""
