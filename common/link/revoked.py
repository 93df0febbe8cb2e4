"""`[link] revoked`: a file with the names of revoked certificates, one a line, read again and again.

Zenoh checks no revocation list and tells only the name of a certificate, so the list holds names. To take a
name from the list permits every certificate that bears it and has not expired.
"""

from __future__ import annotations

import os
from pathlib import Path

from common.errors import LinkError
from common.link.roles import Role, role_of

EVERY_S = 1.0
"""Between two looks at the file."""
MOST_BYTES = 1 << 20


def parse_revoked(text: str, where: str) -> frozenset[str]:
    """The common names in a list's text. Raises LinkError that names the line.

    A line holds `role:name`; what follows a `#` is a comment.
    """
    names = set()
    for number, line in enumerate(text.splitlines(), 1):
        name = line.partition("#")[0].strip()
        if not name:
            continue
        try:
            role_of(name)
        except ValueError:
            raise LinkError(
                f"{where}, line {number}: expected role:name such as operator:nurse-1, not {name!r}"
            ) from None
        names.add(name)
    return frozenset(names)


def revoked_operators(names: frozenset[str]) -> frozenset[str]:
    """The operators among them, by name."""
    return frozenset(name for role, name in map(role_of, names) if role is Role.OPERATOR)


class RevocationFile:
    """The list as it was last read. One that cannot be read any more stays in force as it was."""

    def __init__(self, path: Path) -> None:
        """Raises LinkError if there is no list, or none that can be read: a missing list revokes nobody."""
        self._path = path
        self._seen: tuple[int, int, int] | None = None
        self._trouble = ""
        self.names: frozenset[str] = frozenset()
        if self.look():
            raise LinkError(f"{self._trouble}: [link] revoked names it; an empty file revokes nobody")

    def look(self) -> str:
        """Read the file if it has changed. Returns, once, what a person should know: why it cannot be read.

        It touches the disk, which may stall: call it off the loop.
        """
        trouble = ""
        try:
            seen = _signature(self._path)
            if seen != self._seen:
                self.names = parse_revoked(_read(self._path), str(self._path))
                self._seen = seen
        except LinkError as error:
            trouble = str(error)
        except OSError as error:
            trouble = f"{self._path} cannot be read: {error.strerror}"
        changed = trouble != self._trouble
        self._trouble = trouble
        return trouble if changed else ""


def _signature(path: Path) -> tuple[int, int, int]:
    about = path.stat()
    return about.st_mtime_ns, about.st_size, about.st_ino


def _read(path: Path) -> str:
    with path.open("rb") as file:
        data = file.read(MOST_BYTES + 1)
    if len(data) > MOST_BYTES:
        raise LinkError(f"{path}: expected at most {MOST_BYTES} bytes: is it a list of names?")
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError as error:
        line = data[: error.start].count(b"\n") + 1
        raise LinkError(f"{path}, line {line}: expected UTF-8 text") from None


def write_revoked(path: Path, name: str, note: str) -> bool:
    """Add a name to a list, whole or not at all; False if it is there. Raises LinkError, OSError."""
    text = _read(path) if path.exists() else HEAD
    if name in parse_revoked(text, str(path)):
        return False
    if not text.endswith("\n"):
        text += "\n"
    fresh = path.with_name(f".{path.name}.new")
    with fresh.open("w", encoding="utf-8") as file:
        file.write(f"{text}{name}  # {note}\n")
        file.flush()
        os.fsync(file.fileno())
    fresh.replace(path)
    return True


HEAD = "# Revoked certificates, one name a line. Copy this file to every host; [link] revoked names it.\n"
