"""The log delays nobody, counts the lines it lost, and carries level, time and logger in every line."""

from __future__ import annotations

import logging
import os
import re
import threading
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest

from common.errors import TandemError
from common.log.handler import (
    MAX_WAITING,
    LogFormatter,
    ThreadedLogHandler,
    describe_exception,
    in_journal,
    log_level,
    print_error,
    start_log,
)

ROOT = Path(__file__).parents[3]
ON_TERMINAL = LogFormatter(tracebacks=False, journal=False)
IN_JOURNAL = LogFormatter(tracebacks=False, journal=True)


@pytest.fixture
def pipe() -> Iterator[tuple[int, int]]:
    reading, writing = os.pipe()
    yield reading, writing
    for fd in (reading, writing):
        with suppress(OSError):
            os.close(fd)


def record(
    text: str = "words", error: Exception | None = None, level: int = logging.INFO
) -> logging.LogRecord:
    info = None if error is None else (type(error), error, error.__traceback__)
    return logging.LogRecord("common.x", level, "f.py", 1, text, None, info)


def caught(text: str) -> ValueError:
    try:
        raise ValueError(text)
    except ValueError as error:
        return error


def test_lines_come_in_order(pipe: tuple[int, int]) -> None:
    handler = ThreadedLogHandler(pipe[1])
    for number in range(5):
        handler.emit(record(f"line {number}"))
    handler.flush()
    assert os.read(pipe[0], 1000).decode().split("\n") == [*(f"line {n}" for n in range(5)), ""]


def test_a_blocked_log_delays_nobody_and_counts_the_lines_it_lost(pipe: tuple[int, int]) -> None:
    handler = ThreadedLogHandler(pipe[1])
    handler.setFormatter(ON_TERMINAL)
    long = "x" * 500
    for _ in range(3 * MAX_WAITING):  # a pipe takes 64 KiB: were it written here, this would never return
        handler.emit(record(long))
    handler.flush()
    out: list[bytes] = []
    taking = threading.Thread(
        target=lambda: out.extend(iter(lambda: os.read(pipe[0], 1 << 20), b"")), daemon=True
    )
    taking.start()
    while handler._lines.unfinished_tasks:
        handler.flush()
    handler.emit(record("the last"))
    while handler._lines.unfinished_tasks:
        handler.flush()
    os.close(pipe[1])
    taking.join(10.0)
    text = b"".join(out).decode()
    assert re.search(r"Z WARNING common\.log\.handler: \d+ log lines lost", text)
    assert text.endswith("common.x: the last\n")


def test_a_closed_terminal_ends_no_log(pipe: tuple[int, int]) -> None:
    os.close(pipe[0])
    handler = ThreadedLogHandler(pipe[1])
    for _ in range(10):
        handler.emit(record())
    handler.flush()
    assert not handler._lines.unfinished_tasks


def test_a_line_carries_utc_time_with_milliseconds_level_and_logger() -> None:
    warning = record("bus can0: up again", level=logging.WARNING)
    warning.created, warning.msecs = 1_700_000_000.0625, 62.0
    assert ON_TERMINAL.format(warning) == "2023-11-14T22:13:20.062Z WARNING common.x: bus can0: up again"


@pytest.mark.parametrize(
    ("level", "line"),
    [
        (logging.DEBUG, "<7>common.x: words"),
        (logging.INFO, "<6>common.x: words"),
        (logging.WARNING, "<4>common.x: words"),
        (logging.ERROR, "<3>common.x: words"),
        (logging.CRITICAL, "<2>common.x: words"),
    ],
)
def test_the_journal_gets_the_priority_and_stamps_the_time_itself(level: int, line: str) -> None:
    assert IN_JOURNAL.format(record(level=level)) == line


def test_in_the_journal_every_line_of_a_traceback_has_the_priority() -> None:
    failed = record("handler failed", caught("no such joint"), logging.ERROR)
    lines = LogFormatter(tracebacks=True, journal=True).format(failed).splitlines()
    assert len(lines) > 3
    assert all(line.startswith("<3>") for line in lines)


def test_standard_error_leads_to_the_journal_that_systemd_named(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    stderr = os.fstat(2)
    monkeypatch.setenv("JOURNAL_STREAM", f"{stderr.st_dev}:{stderr.st_ino}")
    assert in_journal()
    monkeypatch.setenv("JOURNAL_STREAM", f"{stderr.st_dev}:{stderr.st_ino + 1}")  # since redirected
    assert not in_journal()
    monkeypatch.delenv("JOURNAL_STREAM")
    assert not in_journal()


def test_last_words_of_a_process_have_a_priority_in_the_journal(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    stderr = os.fstat(2)
    monkeypatch.setenv("JOURNAL_STREAM", f"{stderr.st_dev}:{stderr.st_ino}")
    print_error("slave", "no bus\nno link")
    assert capsys.readouterr().err == "<3>slave: no bus\n<3>slave: no link\n"


def test_an_exception_is_one_line_with_its_place() -> None:
    failed = record("handler of r failed", caught("no such joint"))
    line = ON_TERMINAL.format(failed)
    assert "\n" not in line
    assert "handler of r failed: ValueError: no such joint (test_handler.py:" in line
    assert "Traceback" in LogFormatter(tracebacks=True, journal=False).format(failed)
    assert describe_exception(ValueError("no place")) == "ValueError: no place"


def test_a_line_that_cannot_be_formatted_is_logged_all_the_same(pipe: tuple[int, int]) -> None:
    handler = ThreadedLogHandler(pipe[1])
    broken = record("%d joints")
    broken.args = ("many",)
    handler.emit(broken)
    handler.flush()
    assert b"could not be formatted" in os.read(pipe[0], 1000)


def test_started_twice_it_keeps_one_handler_and_takes_the_new_level(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    root = logging.getLogger()
    monkeypatch.setattr(root, "handlers", [])
    monkeypatch.setattr(root, "level", root.level)
    start_log(logging.INFO)
    start_log(logging.DEBUG)
    (handler,) = root.handlers
    assert root.level == logging.DEBUG
    assert "Traceback" in handler.format(record(error=caught("x")))


def test_debug_and_quiet_set_the_level_and_exclude_each_other() -> None:
    assert log_level(debug=True, quiet=False) == logging.DEBUG
    assert log_level(debug=False, quiet=False) == logging.INFO
    assert log_level(debug=False, quiet=True) == logging.WARNING
    with pytest.raises(TandemError, match="only one"):
        log_level(debug=True, quiet=True)


def test_every_logger_has_the_name_of_its_module() -> None:
    other = [
        f"{path.relative_to(ROOT)}: {call}"
        for room in ("common", "master", "slave", "deploy")
        for path in (ROOT / room).rglob("*.py")
        for call in re.findall(r"getLogger\(([^)]+)\)", path.read_text("utf-8"))
        # the simulated drives quieten the library that they stand on
        if call != "__name__" and (path.name, call) != ("app.py", '"canopen"')
    ]
    assert other == []
