"""From the two files of a soak to its verdicts. Pure."""
