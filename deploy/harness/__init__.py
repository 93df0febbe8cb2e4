"""The running processes of one experiment, and who watches them."""
