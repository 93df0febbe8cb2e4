"""What is in a recording: topics, guard events, pictures, and the stage at which jitter begins."""
