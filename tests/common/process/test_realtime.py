"""Priority and locked memory are taken where permitted; a refusal is told, not fatal."""

from __future__ import annotations

import ctypes
import logging
import os
import resource
import subprocess
import sys

import pytest

from common.process.realtime import enter_real_time


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[object]:
    """What is asked of the kernel, in place of asking it for this very process."""
    calls: list[object] = []

    class Libc:
        def mlockall(self, flags: int) -> int:
            calls.append(flags)
            return 0

    monkeypatch.setattr(ctypes, "CDLL", lambda *_, **__: Libc())
    monkeypatch.setattr(resource, "getrlimit", lambda _: (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
    monkeypatch.setattr(
        os, "sched_setscheduler", lambda pid, policy, param: calls.append((pid, policy, param.sched_priority))
    )
    return calls


def test_it_asks_for_memory_and_fifo_with_the_priority(asked: list[object]) -> None:
    assert enter_real_time(20)
    # what is there, what comes, and each page from its first use on: not all that is mapped, at once
    assert asked == [1 | 2 | 4, (0, os.SCHED_FIFO, 20)]


def test_zero_leaves_scheduler_and_memory_alone(asked: list[object]) -> None:
    assert not enter_real_time(0)
    assert asked == []


def test_a_refusal_is_told_with_what_to_do(
    asked: list[object], monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def refuse(*_: object) -> None:
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    with caplog.at_level(logging.WARNING):
        assert not enter_real_time(20)
    assert "CAP_SYS_NICE" in caplog.text
    assert "CAP_IPC_LOCK" not in caplog.text


def test_under_a_limit_nothing_is_locked_and_it_is_told(
    asked: list[object], monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """A limit reached later would make an allocation fail in the middle of a run."""
    monkeypatch.setattr(os, "geteuid", lambda: 1000)
    monkeypatch.setattr(resource, "getrlimit", lambda _: (1 << 33, 1 << 33))
    with caplog.at_level(logging.WARNING):
        assert enter_real_time(20)
    assert asked == [(0, os.SCHED_FIFO, 20)]
    assert "CAP_IPC_LOCK" in caplog.text


def test_what_is_used_is_locked_in_truth() -> None:
    said = subprocess.run([sys.executable, "-c", _USES_MEMORY], capture_output=True, text=True, check=True)
    if "memory is not locked" in said.stderr:
        pytest.skip(said.stderr.strip())
    before_kb, after_kb, size_kb = map(int, said.stdout.split())
    assert before_kb == 0
    assert 40_000 < after_kb < size_kb  # the 40 MB that were used, not all that is mapped


_USES_MEMORY = """
from pathlib import Path
from common.process.realtime import enter_real_time

def status(key):
    return next(l.split()[1] for l in Path("/proc/self/status").read_text().splitlines() if l.startswith(key))

before = status("VmLck")
enter_real_time(1)
used = b"x" * 40_000_000
print(before, sum(int(l.split()[1]) for l in Path("/proc/self/smaps").read_text().splitlines()
      if l.startswith("Locked:")), status("VmSize"))
"""
