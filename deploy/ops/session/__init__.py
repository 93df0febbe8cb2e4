"""`tandem session`: records a session of a study, seals it, and shows what was changed."""
