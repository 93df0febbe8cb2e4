"""A group of commands with a default command."""

from __future__ import annotations

from typing import Any

from typer.core import TyperGroup


class FilesByDefault(TyperGroup):
    """Runs the command `files` where the first argument is neither a command nor `--help`."""

    default = "files"

    # Any: typer keeps the type of its context in a private module
    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Insert the default command's name."""
        if args and args[0] != "--help" and args[0] not in self.commands:
            args = [self.default, *args]
        return super().parse_args(ctx, args)


class SimulateByDefault(FilesByDefault):
    """Runs the command `simulate` there."""

    default = "simulate"
