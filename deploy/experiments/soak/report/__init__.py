"""The report of a soak: JSON, one HTML page and its plot."""
