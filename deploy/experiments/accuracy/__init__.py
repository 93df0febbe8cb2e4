"""`tandem accuracy`: one file a command."""
