"""A suit without hardware: a CAN peer that answers SYNC with what the nodes of a moving person would read."""
