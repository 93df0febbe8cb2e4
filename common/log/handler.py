"""The log: lines with level, UTC time and logger, written by a thread of its own.

A terminal or a journal that takes no more lines delays no loop. Each module logs as `getLogger(__name__)`.
"""

from __future__ import annotations

import logging
import os
import queue
import sys
import threading
import time
import traceback
from contextlib import suppress
from pathlib import Path

from common.errors import TandemError
from common.log.streams import LossyRaw

MAX_WAITING = 1000
"""Lines that wait to be written; further ones are lost and counted."""
FLUSH_S = 0.5
"""The longest wait at the end of the process for lines not yet written."""
_STDERR = 2
BELL = {"bell": True}
"""As `extra` of a log call: a terminal sounds its bell with the line."""

log = logging.getLogger(__name__)


class LogFormatter(logging.Formatter):
    """`TIME LEVEL LOGGER: TEXT`; for the journal `<PRIORITY>LOGGER: TEXT`, since it stamps the time itself.

    Without `tracebacks`, an exception becomes one line: its type, text and place.
    """

    def __init__(self, *, tracebacks: bool, journal: bool) -> None:
        time_and_level = "" if journal else "%(asctime)s.%(msecs)03dZ %(levelname)s "
        super().__init__(f"{time_and_level}%(name)s: %(message)s", "%Y-%m-%dT%H:%M:%S")
        self.converter = time.gmtime
        self._tracebacks = tracebacks
        self._journal = journal

    def format(self, record: logging.LogRecord) -> str:
        """The record as text; several lines only where it carries several."""
        if not self._tracebacks and record.exc_info and record.exc_info[1] is not None:
            bare = logging.makeLogRecord({**record.__dict__, "exc_info": None, "exc_text": None})
            text = f"{super().format(bare)}: {describe_exception(record.exc_info[1])}"
        else:
            text = super().format(record)
        return with_priority(text, record.levelno) if self._journal else text


class ThreadedLogHandler(logging.Handler):
    """Writes to a file descriptor from its own thread. No call blocks or raises."""

    def __init__(self, fd: int = _STDERR) -> None:
        super().__init__()
        self._raw = LossyRaw(fd)
        self._lines: queue.Queue[str] = queue.Queue(MAX_WAITING)
        self._lost = 0
        self._thread: threading.Thread | None = None

    def emit(self, record: logging.LogRecord) -> None:
        """Hand a line to the thread."""
        try:
            line = self.format(record)
            if getattr(record, "bell", False) and self._raw.isatty():
                line = "\a" + line
        except Exception as error:
            line = self._own_line(f"a log line could not be formatted ({error}): {record.msg!r}")
        try:
            self._lines.put_nowait(line)
        except queue.Full:
            self._lost += 1
        if self._thread is None:
            self._thread = threading.Thread(target=self._write, name="log", daemon=True)
            self._thread.start()

    def flush(self) -> None:
        """Wait until all lines are written, but at most FLUSH_S."""
        until_s = time.monotonic() + FLUSH_S
        while self._lines.unfinished_tasks and time.monotonic() < until_s:
            time.sleep(0.002)

    def _own_line(self, text: str) -> str:
        return self.format(log.makeRecord(log.name, logging.WARNING, __file__, 0, text, (), None))

    def _write(self) -> None:
        with suppress(OSError, AttributeError):  # the loop's real-time priority is not for its log
            os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
        while True:
            line = self._lines.get()
            lost, self._lost = self._lost, 0
            if lost:
                line = f"{self._own_line(f'{lost} log lines lost: standard error was blocked')}\n{line}"
            # not through the text stream: no thread may hold its lock when the process ends
            self._raw.write(f"{line}\n".encode("utf-8", "replace"))
            self._lines.task_done()


def log_level(*, debug: bool, quiet: bool) -> int:
    """The level that the options `--debug` and `--quiet` ask for. Raises TandemError where both are given."""
    if debug and quiet:
        raise TandemError("--debug and --quiet: expected only one of the two")
    return logging.DEBUG if debug else logging.WARNING if quiet else logging.INFO


def start_log(level: int) -> None:
    """Log from `level` up to standard error. Leaves a log alone that was set up before by others."""
    logging.raiseExceptions = False
    root = logging.getLogger()
    if not root.handlers:
        root.addHandler(ThreadedLogHandler())
    for handler in root.handlers:
        if isinstance(handler, ThreadedLogHandler):
            root.setLevel(level)
            handler.setFormatter(LogFormatter(tracebacks=level <= logging.DEBUG, journal=in_journal()))


def flush_log() -> None:
    """Wait until the log is written, before a last message is printed beside it."""
    for handler in logging.getLogger().handlers:
        handler.flush()


def print_error(program: str, text: str) -> None:
    """Write why a program ends, below its log: `PROGRAM: LINE` for each line."""
    flush_log()
    for line in text.splitlines():
        message = f"{program}: {line}"
        sys.stderr.write((with_priority(message, logging.ERROR) if in_journal() else message) + "\n")


def describe_exception(error: BaseException) -> str:
    """An exception in one line: type, text, file and line."""
    frames = traceback.extract_tb(error.__traceback__)
    place = f" ({Path(frames[-1].filename).name}:{frames[-1].lineno})" if frames else ""
    return f"{type(error).__name__}: {error}{place}"


def in_journal() -> bool:
    """Whether standard error leads to systemd's journal (JOURNAL_STREAM of systemd.exec(5))."""
    try:
        stderr = os.fstat(_STDERR)
    except OSError:
        return False
    return os.environ.get("JOURNAL_STREAM") == f"{stderr.st_dev}:{stderr.st_ino}"


def with_priority(text: str, level: int) -> str:
    """The text with the journal's priority before each line (sd-daemon(3)): `<3>` for an error."""
    if level >= logging.CRITICAL:
        priority = 2
    elif level >= logging.ERROR:
        priority = 3
    elif level >= logging.WARNING:
        priority = 4
    else:
        priority = 6 if level >= logging.INFO else 7
    return "\n".join(f"<{priority}>{line}" for line in text.splitlines())
