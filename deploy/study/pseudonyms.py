"""The table of names and codes, kept apart from the study; and a search for names where none may be."""

from __future__ import annotations

import csv
import os
import secrets
from collections.abc import Sequence
from pathlib import Path
from urllib.parse import unquote

from common.errors import RecordingError, TandemError
from common.recording import RecordingStream

LETTERS = "abcdefghjkmnpqrstuvwxyz23456789"
"""Without those that look alike."""
CODE_LENGTH = 4
SHORTEST = 3
"""Letters of a name that is searched for: shorter ones are in every file by chance. Of other scripts, 2."""
_APART = str.maketrans(dict.fromkeys(" _-.,", ""))
"""What may stand between the parts of a name."""


class Pseudonyms:
    """A CSV file of codes and names, for its owner's eyes alone (mode 0600)."""

    def __init__(self, path: Path, study: Path | None = None) -> None:
        """Raises TandemError where the table would lie in the study's own folder, or others may read it."""
        if study is not None and path.resolve().is_relative_to(study.resolve()):
            raise TandemError(f"{path}: the table of names must not lie in the study's folder {study}")
        self.path = path
        if path.exists() and path.stat().st_mode & 0o077:
            raise TandemError(f"{path}: others may read it; chmod 600 {path}")

    def names(self) -> dict[str, str]:
        """Names by code."""
        if not self.path.exists():
            return {}
        with self.path.open(newline="", encoding="utf-8") as stream:
            return {row["code"]: row["name"] for row in csv.DictReader(stream)}

    def add(self, name: str) -> str:
        """The code of a person, a new one for a new name."""
        known = self.names()
        for code, other in known.items():
            if other == name:
                return code
        code = _draw(known)
        new = not self.path.exists()
        descriptor = os.open(self.path, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o600)
        with os.fdopen(descriptor, "a", newline="", encoding="utf-8") as stream:
            writer = csv.writer(stream)
            if new:
                writer.writerow(["code", "name"])
            writer.writerow([code, name])
        return code

    def remove(self, code: str) -> bool:
        """Forget a person; False where the code is not known."""
        known = self.names()
        if known.pop(code, None) is None:
            return False
        beside = self.path.with_name(f".{self.path.name}.new")
        descriptor = os.open(beside, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
        with os.fdopen(descriptor, "w", newline="", encoding="utf-8") as stream:
            csv.writer(stream).writerows([["code", "name"], *known.items()])
        beside.replace(self.path)
        return True


def _draw(known: dict[str, str]) -> str:
    while True:
        code = "".join(secrets.choice(LETTERS) for _ in range(CODE_LENGTH))
        if code not in known:
            return code


def _written(name: str) -> set[str]:
    """How a name may stand in a file, without what is between its parts; empty where it is too short."""
    parts = name.casefold().translate(str.maketrans("_-.,", "    ")).split()
    joined = "".join(parts)
    return (
        {joined, "".join(reversed(parts))} if len(joined) >= (SHORTEST if joined.isascii() else 2) else set()
    )


def too_short(names: Sequence[str]) -> int:
    """How many names are not searched for."""
    return sum(not _written(name) for name in names)


def names_in(folder: Path, names: Sequence[str]) -> list[str]:
    """Where in a folder's files a name stands, in words: file, and in a recording the topic.

    A name is found in large and small letters, with its parts in both orders: Li Mei, mei_li, LIMEI.
    """
    wanted = sorted({form for name in names for form in _written(name)})
    found = []
    for path in sorted(path for path in folder.rglob("*") if path.is_file()):
        if _in(path.relative_to(folder).as_posix().encode(errors="ignore"), wanted):
            found.append(f"{path}: its own name")
        if path.suffix == ".mcap":
            found += _in_recording(path, wanted)
        elif _in(path.read_bytes(), wanted):
            found.append(f"{path}")
    return found


def _in_recording(path: Path, wanted: Sequence[str]) -> list[str]:
    topics: dict[str, None] = {}
    stream = RecordingStream(path)
    try:
        for entry in stream:
            # an operator's name is a part of the key of each command
            said = unquote(entry.topic).encode() + b" " + entry.payload
            if entry.topic not in topics and _in(said, wanted):
                topics[entry.topic] = None
    except RecordingError as error:
        return [f"{path}: cannot be searched: {error}"]
    head = " ".join((stream.metadata or {}).values())
    in_head = [f"{path}: its head"] if _in(head.encode(), wanted) else []
    return in_head + [f"{path}: {topic}" for topic in topics]


def _in(data: bytes, wanted: Sequence[str]) -> bool:
    text = data.decode("utf-8", "ignore").casefold().translate(_APART)
    return any(name in text for name in wanted)
