"""A live robot's topics into a file, and what is in such a file."""
