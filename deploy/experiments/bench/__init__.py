"""`tandem bench`: is this machine good enough? One file a subject; `run.py` puts them together."""
