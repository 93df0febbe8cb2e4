"""Joints without a servo."""
