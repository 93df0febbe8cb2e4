"""What a fleet costs: many light robots with real sessions, one or more real masters without a suit."""
