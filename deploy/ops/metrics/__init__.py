"""`tandem metrics`: what both sides publish each second, for Prometheus."""
