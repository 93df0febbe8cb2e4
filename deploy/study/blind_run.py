"""A process of which nobody is to read the transport: in its log, or in the error that ends it."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from common.errors import TandemError
from deploy.study.blinding import hide_transports, read_key


class HidingFormatter(logging.Formatter):
    """Formats as another one does, and hides transports in the whole line."""

    def __init__(self, inner: logging.Formatter) -> None:
        super().__init__()
        self._inner = inner

    def format(self, record: logging.LogRecord) -> str:
        """The other's line, without transports."""
        return hide_transports(self._inner.format(record))


def connect_of(key: Path, code: str) -> list[str]:
    """Where the master connects in a condition. Raises TandemError where the key does not say it."""
    connect = read_key(key).condition(code).connect
    if not connect:
        raise TandemError(
            f"{key}: the condition {code} has no `connect`: where does the master reach the robot?"
        )
    return connect


@contextmanager
def transports_hidden() -> Iterator[None]:
    """Within it, log lines and errors that a person can cause name no transport and no endpoint."""
    for handler in logging.getLogger().handlers:
        handler.setFormatter(HidingFormatter(handler.formatter or logging.Formatter()))
    try:
        yield
    except TandemError as error:
        raise TandemError(hide_transports(str(error))) from None
