"""A group of commands of which one may go without its name."""

from __future__ import annotations

from typing import Any

from typer.core import TyperGroup


class FilesByDefault(TyperGroup):
    """What begins with no command's name (and asks for no help) is for the command `files`."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Put the name in where it was left out."""
        if args and args[0] != "--help" and args[0] not in self.commands:
            args = ["files", *args]
        return super().parse_args(ctx, args)
