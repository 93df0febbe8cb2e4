"""Starts the processes of an experiment, observes them, engages their robots, and watches the host."""
