"""Every error a person or a peer can cause; the command line prints them as one line each, no traceback."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path


class TandemError(Exception):
    """Base of all errors that tandem raises on purpose; the text says what was wrong and what to do."""


@dataclass(frozen=True, slots=True)
class ConfigMistake:
    """One wrong entry of a configuration file."""

    key: str
    value: object
    expected: str


class _NotSet:
    def __repr__(self) -> str:
        return "(not set)"


NOT_SET = _NotSet()
"""The value of a key that is missing."""
_LONGEST_VALUE = 100


class ConfigError(TandemError):
    """A configuration file that cannot be used: one line a mistake, with file, key, value, expectation."""

    def __init__(self, path: Path | str, mistakes: list[ConfigMistake]) -> None:
        self.path = Path(path)
        self.mistakes = mistakes
        super().__init__(
            "\n".join(f"{path}: {m.key} = {_short(m.value)}: expected {m.expected}" for m in mistakes)
        )


class CodecError(TandemError):
    """A message from the wire that is not what its topic carries; count it and drop it."""


class BusError(TandemError):
    """A CAN bus that cannot be opened or has failed."""


class LinkError(TandemError):
    """A Zenoh session that cannot be opened, or a peer that does not answer."""


class LinkTimeoutError(LinkError, TimeoutError):
    """A peer that did not answer in time."""


class NetworkError(TandemError):
    """Hosts on one machine, or the emulated link between them, that cannot be set up."""


class RecordingError(TandemError):
    """A recording that cannot be written or used; the text says what is wrong with it and what to do."""


class RobotError(TandemError):
    """A robot, servo or encoder that cannot be used."""


def _short(value: object) -> str:
    text = repr(value)
    return text if len(text) <= _LONGEST_VALUE else text[: _LONGEST_VALUE - 1] + "…"
