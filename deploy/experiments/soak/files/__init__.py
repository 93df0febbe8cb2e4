"""The files that a soak writes while it runs: its options, events and samples."""
