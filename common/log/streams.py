"""Standard streams that never raise: closed, full, cut off or unable to show a letter, they only lose text.

A robot's stop must not depend on what becomes of the terminal that asked for it. `secure` is called once, at
the start of each process of tandem.
"""

from __future__ import annotations

import codecs
import errno
import io
import os
import select
import sys
import unicodedata
from typing import TYPE_CHECKING, TextIO

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer as Buffer

_AS_ASCII = {
    "°": " deg", "µ": "u", "μ": "u", "±": "+/-", "–": "-", "—": "-", "−": "-", "‖": "||", "×": "x",
    "→": "->", "←": "<-", "…": "...", "·": ".", "▸": ">", "▶": ">", "─": "-", "│": "|", "≥": ">=", "≤": "<=",
    "√": "sqrt", "η": "eta", "σ": "sigma", "ω": "omega", "Δ": "delta", "Σ": "sum", "█": "#", "●": "*",
    "✓": "ok", "✗": "x", "’": "'", "‘": "'", "“": '"', "”": '"',
}  # fmt: skip
_HANDLER = "tandem-as-the-terminal-can"


class LossyRaw(io.FileIO):
    """A descriptor for writing. What cannot be written is lost, and `trouble` says why; it never raises."""

    def __init__(self, fd: int) -> None:
        super().__init__(fd, "wb", closefd=False)
        self.trouble: OSError | None = None
        """The first failure; from then on nothing is tried any more."""

    def write(self, data: Buffer, /) -> int:
        """Take all of it."""
        rest = memoryview(data).cast("B")
        size, fd = len(rest), self.fileno()
        while rest and self.trouble is None:
            try:
                rest = rest[os.write(fd, rest) :]
            except BlockingIOError:
                # another process made the terminal non-blocking: it is still there
                select.select([], [fd], [])
            except OSError as error:
                self.trouble = error
        return size


def lossy(fd: int, like: TextIO | None, buffered: bool) -> TextIO:
    """A text stream to a descriptor, encoded as `like` is; what that cannot show is spelled in ASCII."""
    codecs.register_error(_HANDLER, _spelled)
    raw = LossyRaw(fd)
    buffer = io.BufferedWriter(raw)
    by_line = not buffered or raw.isatty()
    encoding = getattr(like, "encoding", None) or "utf-8"
    return io.TextIOWrapper(
        buffer, encoding=encoding, errors=_HANDLER, line_buffering=by_line, write_through=not buffered
    )


def secure() -> None:
    """Make this process's standard streams such. Descriptors 0 to 2 that are closed lead to /dev/null.

    Else what is opened next takes their numbers: a socket then reads as standard input, and uvloop aborts the
    process as it ends. Streams that were replaced before, such as by a test, stay.
    """
    for fd in (0, 1, 2):
        try:
            os.fstat(fd)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # takes the lowest number that is free: this one
    if sys.stdin is None:
        sys.stdin = open(0, encoding="utf-8", closefd=False)  # noqa: SIM115
    if sys.stdout is sys.__stdout__:
        sys.stdout = lossy(1, sys.__stdout__, buffered=True)
    if sys.stderr is sys.__stderr__:
        sys.stderr = lossy(2, sys.__stderr__, buffered=False)


def lost_output() -> str | None:
    """Why standard output was not written in full; None where it was, or where its reader went away."""
    try:
        sys.stdout.flush()
    except (OSError, ValueError) as error:
        return str(error)
    raw = getattr(getattr(sys.stdout, "buffer", None), "raw", None)
    trouble = raw.trouble if isinstance(raw, LossyRaw) else None
    # a reader that has seen enough, as `head` does, or a terminal that was closed, wants no more
    if trouble is None or trouble.errno in (errno.EPIPE, errno.EIO):
        return None
    return trouble.strerror or str(trouble)


def _spelled(error: UnicodeError) -> tuple[str, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    unshown = error.object[error.start : error.end]
    return "".join(map(_ascii, unshown)), error.end


def _ascii(letter: str) -> str:
    if letter in _AS_ASCII:
        return _AS_ASCII[letter]
    plain = unicodedata.normalize("NFKD", letter).encode("ascii", "ignore").decode("ascii")
    return plain or "?"
