"""Recordings of others: one reader a format, all of them in one table."""
