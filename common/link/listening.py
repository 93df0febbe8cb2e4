"""Hears Zenoh's log, which it writes to standard output, and hands it to `Refusals`. Once a process.

What the process itself prints goes where it went before. The pipe never blocks Zenoh: a line that does
not fit is lost, and so is its count.
"""

from __future__ import annotations

import fcntl
import logging
import os
import re
import sys
import threading
from typing import IO

import zenoh

from common.clock import monotonic_ns
from common.link.refusals import FILTER, Refusals

PIPE_BYTES = 1 << 20
_COLOURS = re.compile(r"\x1b\[[0-9;]*m")
_TELLING = (b"unauthorized", b"intercepted", b"CertCommonName", b" WARN", b"\x1b[33m WARN")

log = logging.getLogger("tandem.refused")
_heard: Refusals | None = None


def hear_refusals() -> Refusals:
    """Begin to count, before the first session opens; the same counts each time."""
    global _heard
    if _heard is None:
        _heard = Refusals()
        log_file = _divert_standard_output()
        threading.Thread(target=_listen, args=(log_file, _heard), name="refusals", daemon=True).start()
        zenoh.init_log_from_env_or(FILTER)
    return _heard


def _divert_standard_output() -> IO[bytes]:
    sys.stdout.flush()
    own = os.fdopen(os.dup(1), "w", encoding=sys.stdout.encoding, errors=sys.stdout.errors, buffering=1)
    reading, writing = os.pipe()
    fcntl.fcntl(writing, fcntl.F_SETPIPE_SZ, PIPE_BYTES)
    os.set_blocking(writing, False)
    os.dup2(writing, 1)
    os.close(writing)
    sys.stdout = own
    return os.fdopen(reading, "rb", buffering=1 << 16)


def _listen(log_file: IO[bytes], refusals: Refusals) -> None:
    for line in log_file:
        # most lines are messages that passed: one look, and nothing else holds the interpreter
        if any(word in line for word in _TELLING):
            text = _COLOURS.sub("", line.decode("utf-8", "replace"))
            said = refusals.feed(text, monotonic_ns())
            if said is not None:
                log.warning("%s", said)
