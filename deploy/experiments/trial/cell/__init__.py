"""One cell of a trial: what is run, how it runs, what was recorded, and its measured values."""
