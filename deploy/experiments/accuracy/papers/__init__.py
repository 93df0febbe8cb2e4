"""The papers' experiments on the simulated suit, beside the papers' figures. Open `command.py` first."""
