"""The log holds up nobody, says what it lost, and keeps tracebacks for `--debug`."""

from __future__ import annotations

import logging
import os
import threading
from collections.abc import Iterator
from contextlib import suppress

import pytest

from common.process.logs import FORMAT, MOST_WAITING, OneLine, PatientHandler, in_words


@pytest.fixture
def pipe() -> Iterator[tuple[int, int]]:
    reading, writing = os.pipe()
    yield reading, writing
    for fd in (reading, writing):
        with suppress(OSError):
            os.close(fd)


def record(text: str = "words", error: Exception | None = None) -> logging.LogRecord:
    info = None if error is None else (type(error), error, error.__traceback__)
    return logging.LogRecord("tandem.x", logging.INFO, "f.py", 1, text, None, info)


def test_lines_come_in_order(pipe: tuple[int, int]) -> None:
    handler = PatientHandler(pipe[1])
    for number in range(5):
        handler.emit(record(f"line {number}"))
    handler.flush()
    assert os.read(pipe[0], 1000).decode().split("\n") == [*(f"line {n}" for n in range(5)), ""]


def test_a_log_that_is_not_taken_holds_up_nobody_and_says_what_it_lost(pipe: tuple[int, int]) -> None:
    handler = PatientHandler(pipe[1])
    long = "x" * 500
    for _ in range(3 * MOST_WAITING):  # a pipe takes 64 KiB: were it written here, this would never return
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
    assert "lines lost here" in text
    assert text.endswith("the last\n")


def test_a_closed_terminal_ends_no_log(pipe: tuple[int, int]) -> None:
    os.close(pipe[0])
    handler = PatientHandler(pipe[1])
    for _ in range(10):
        handler.emit(record())
    handler.flush()
    assert not handler._lines.unfinished_tasks


def test_an_exception_is_one_line_with_its_place() -> None:
    def deep() -> None:
        raise ValueError("no such joint")

    with pytest.raises(ValueError, match="joint") as caught:
        deep()
    line = OneLine(FORMAT).format(record("handler of r failed", caught.value))
    assert "\n" not in line
    assert "handler of r failed: ValueError: no such joint (test_logs.py:" in line
    assert "Traceback" in logging.Formatter(FORMAT).format(record("x", caught.value))
    assert in_words(ValueError("no place")) == "ValueError: no place"


def test_what_cannot_be_formatted_is_said_all_the_same(pipe: tuple[int, int]) -> None:
    handler = PatientHandler(pipe[1])
    broken = record("%d joints")
    broken.args = ("many",)
    handler.emit(broken)
    handler.flush()
    assert b"cannot be formatted" in os.read(pipe[0], 1000)
