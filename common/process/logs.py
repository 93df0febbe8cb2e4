"""The log, written by its own thread: a terminal or a journal that does not take it holds up no robot."""

from __future__ import annotations

import logging
import os
import queue
import threading
import time
import traceback
from contextlib import suppress
from pathlib import Path

from common.process.streams import LossyRaw

MOST_WAITING = 1000
"""Lines; what comes beyond is lost, and counted."""
FLUSH_S = 0.5
"""How long the end of the process waits for what is still to be written."""
FORMAT = "%(asctime)s %(name)s: %(message)s"


class OneLine(logging.Formatter):
    """A traceback becomes the exception's words and place; whole ones are for `--debug`."""

    def format(self, record: logging.LogRecord) -> str:
        """One line, whatever the record carries."""
        if not record.exc_info or record.exc_info[1] is None:
            return super().format(record)
        bare = logging.makeLogRecord({**record.__dict__, "exc_info": None, "exc_text": None})
        return f"{super().format(bare)}: {in_words(record.exc_info[1])}"


class PatientHandler(logging.Handler):
    """Writes to a descriptor from its own thread. No call blocks or raises."""

    def __init__(self, fd: int = 2) -> None:
        super().__init__()
        self._raw = LossyRaw(fd)
        self._lines: queue.Queue[str] = queue.Queue(MOST_WAITING)
        self._lost = 0
        self._thread: threading.Thread | None = None

    def emit(self, record: logging.LogRecord) -> None:
        """Hand a line to the thread."""
        try:
            line = self.format(record)
        except Exception as error:
            line = f"a line that cannot be formatted ({error}): {record.msg!r}"
        try:
            self._lines.put_nowait(line)
        except queue.Full:
            self._lost += 1
        if self._thread is None:
            self._thread = threading.Thread(target=self._write, name="log", daemon=True)
            self._thread.start()

    def flush(self) -> None:
        """Wait until all is written, for FLUSH_S at most."""
        until_s = time.monotonic() + FLUSH_S
        while self._lines.unfinished_tasks and time.monotonic() < until_s:
            time.sleep(0.002)

    def _write(self) -> None:
        with suppress(OSError):  # a loop's real-time priority is not for its log
            os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
        while True:
            line = self._lines.get()
            lost, self._lost = self._lost, 0
            if lost:
                line = f"({lost} lines lost here: the log was not taken)\n{line}"
            # past the text stream: its lock must not be held by a thread that waits when the process ends
            self._raw.write(f"{line}\n".encode("utf-8", "replace"))
            self._lines.task_done()


def start_log(level: int) -> None:
    """Log from `level` up to standard error; a log that somebody has set up already is let be."""
    logging.raiseExceptions = False
    handler = PatientHandler()
    handler.setFormatter((logging.Formatter if level <= logging.DEBUG else OneLine)(FORMAT))
    logging.basicConfig(level=level, handlers=[handler])


def flush_log() -> None:
    """Before a last word is written beside it."""
    for handler in logging.getLogger().handlers:
        handler.flush()


def in_words(error: BaseException) -> str:
    """An exception in one line: kind, text and place."""
    where = traceback.extract_tb(error.__traceback__)
    place = f" ({Path(where[-1].filename).name}:{where[-1].lineno})" if where else ""
    return f"{type(error).__name__}: {error}{place}"
