"""Under which heading of `tandem --help` each command stands, so that a stranger finds it."""

from __future__ import annotations

import typer

PANELS = {
    "Run": ("demo", "master", "slave", "console", "suit", "router", "drives"),
    "People": (
        "robots", "take", "engage", "disengage", "let-go", "handover", "rest", "take-up", "estop", "reset",
        "home", "status", "call", "attitude", "video", "voice", "ros",
    ),
    "Set up": (
        "doctor", "servos", "inputs", "stops", "alarms", "calibrate", "profile", "keys", "record",
        "inspect", "session", "import", "export",
        "metrics", "lsl",
    ),
    "Judge": (
        "prove", "replay", "trial", "soak", "faults", "collisions", "contact", "bench", "accuracy", "network",
        "audit",
    ),
}  # fmt: skip
"""In the order of the help."""
_PANEL = {name: panel for panel, names in PANELS.items() for name in names}


def arrange(app: typer.Typer) -> None:
    """Put every command that the table names under its heading, in the table's order; others stay last."""
    order = list(_PANEL)
    for command in app.registered_commands:
        command.name = command.name or getattr(command.callback, "__name__", "").replace("_", "-")
        if command.name in _PANEL:
            command.rich_help_panel = _PANEL[command.name]
    for group in app.registered_groups:
        if group.name in _PANEL:
            group.rich_help_panel = _PANEL[group.name]
    app.registered_commands.sort(key=lambda c: order.index(c.name) if c.name in _PANEL else len(order))
