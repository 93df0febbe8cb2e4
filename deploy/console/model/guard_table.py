"""The guard's states and how they follow each other, for the engineer's page. Pure.

A copy of the slave's table, which a test compares with it: to import that one loads MuJoCo, 25 MB.
"""

from __future__ import annotations

STATES = ("boot", "hold", "align", "track", "clutch", "estop")
ENGAGED = ("align", "track", "clutch")
_LOSS = "loss of lease, deadman, command or encoder"
TRANSITIONS = (
    ("boot", "all encoders valid", "hold"),
    ("hold", "engage", "align"),
    ("align", "every joint within its window", "track"),
    ("align", "disengage", "hold"),
    ("align", _LOSS, "hold"),
    ("track", "disengage", "hold"),
    ("track", _LOSS, "hold"),
    ("align", "clutch released", "clutch"),
    ("track", "clutch released", "clutch"),
    ("clutch", "clutch pressed again", "align"),
    ("clutch", "disengage", "hold"),
    ("clutch", _LOSS, "hold"),
    *((state, "e-stop", "estop") for state in STATES),
    ("estop", "reset", "hold"),
)
"""Before, by what, after."""
