"""`tandem lsl`: joints, targets, latency and events for Lab Streaming Layer."""
