"""Everything that launches, demonstrates and judges the two sides."""
