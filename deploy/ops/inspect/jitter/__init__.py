"""Finds the stage at which jitter begins, on the way from the nodes to the encoders."""
