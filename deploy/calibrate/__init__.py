"""`tandem calibrate`: one file a command."""
