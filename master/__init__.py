"""The operator's side: nodes on CAN in, joint commands out."""
