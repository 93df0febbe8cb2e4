"""Recordings of others in, joint angles for others out."""
