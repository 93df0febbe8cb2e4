"""The report of a trial: spread over repeats, ranking by care task, targets, plots, HTML, JSON and CSV."""
