"""The operator's suit: nodes on CAN, asked by one SYNC a tick. Open `poll` first, then `protocol`, `bus`."""
