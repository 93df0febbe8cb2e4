"""Reads Zenoh's log, which Zenoh writes to standard output, and hands it to `Refusals`. Once a process.

What the process itself prints goes where it went before. The pipe never blocks Zenoh: a line that does
not fit is lost, and so is its count.
"""

from __future__ import annotations

import logging
import os
import re
import sys
import threading
import time

import zenoh

from common.clock import monotonic_ns
from common.link.refusals import HANDSHAKES, MESSAGES, Refusals
from common.log.streams import lossy

PIPE_BYTES = 1 << 20
LOOK_S = 0.1
_COLOURS = re.compile(r"\x1b\[[0-9;]*m")
_RELEVANT = (b"unauthorized", b"intercepted", b"CertCommonName", b" WARN", b"\x1b[33m WARN")

log = logging.getLogger(__name__)
_heard: Refusals | None = None


def hear_refusals(messages: bool = True) -> Refusals:
    """Begin to count, before the first session opens; the same counts each time.

    `messages`: of those, too, that come from sessions which are let in.
    """
    global _heard
    if _heard is None:
        _heard = Refusals()
        reading = _divert_standard_output()
        threading.Thread(target=_listen, args=(reading, _heard), name="refusals", daemon=True).start()
        zenoh.init_log_from_env_or(MESSAGES if messages else HANDSHAKES)
    return _heard


def _divert_standard_output() -> int:
    sys.stdout.flush()
    own = lossy(os.dup(1), sys.stdout, buffered=False)
    reading, writing = os.pipe()
    _widen(writing)
    os.set_blocking(writing, False)
    os.dup2(writing, 1)
    os.close(writing)
    sys.stdout = own
    return reading


def _widen(writing: int) -> None:
    """Room for a burst of lines, where the system lets a pipe have it (Linux)."""
    try:
        import fcntl

        fcntl.fcntl(writing, fcntl.F_SETPIPE_SZ, PIPE_BYTES)
    except (ImportError, AttributeError, OSError) as error:
        log.debug("the pipe of Zenoh's log keeps its size: %s", error)


def _listen(reading: int, refusals: Refusals) -> None:
    rest = b""
    while True:
        # now and then, not line by line: to be woken for each message cost it 70 µs on its way
        time.sleep(LOOK_S)
        *lines, rest = (rest + os.read(reading, PIPE_BYTES)).split(b"\n")
        for line in lines:
            # most lines are messages that passed: one look, and nothing else holds the interpreter
            if any(word in line for word in _RELEVANT):
                text = _COLOURS.sub("", line.decode("utf-8", "replace"))
                refusal = refusals.feed(text, monotonic_ns())
                if refusal is not None:
                    log.warning("%s", refusal)
