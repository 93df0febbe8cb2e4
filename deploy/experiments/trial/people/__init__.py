"""How each tracking strategy follows real people over a delay, on a virtual clock."""
