"""`tandem trial paths`: one path against two, on a virtual clock."""
