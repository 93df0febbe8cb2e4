"""`tandem trial` answers which transport, over this network, suits this care task."""
