"""Small files below a root folder: `/` on a host, a made-up tree in a test."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

ROOT = Path("/")


@dataclass(frozen=True, slots=True)
class Tree:
    """Reads below `root`; what is not there is None or empty, never an error."""

    root: Path = ROOT

    def at(self, path: str) -> Path:
        """Where an absolute path lies in this tree."""
        return self.root / path.lstrip("/")

    def text(self, path: str) -> str | None:
        """A file's text without white space around it; None where it cannot be read."""
        try:
            return self.at(path).read_text("utf-8", "replace").strip()
        except OSError:
            return None

    def number(self, path: str) -> int | None:
        """A file that holds one decimal number."""
        text = self.text(path)
        try:
            return None if text is None else int(text)
        except ValueError:
            return None

    def names(self, path: str) -> list[str]:
        """What a folder holds, sorted."""
        try:
            return sorted(entry.name for entry in self.at(path).iterdir())
        except OSError:
            return []

    def fields(self, path: str) -> dict[str, str]:
        """A file of `Name: value` lines."""
        parts = (line.partition(":") for line in (self.text(path) or "").splitlines())
        return {name.strip(): value.strip() for name, colon, value in parts if colon}
