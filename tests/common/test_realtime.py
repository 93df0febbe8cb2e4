"""A real-time priority is taken where permitted, and its refusal is told, not fatal."""

from __future__ import annotations

import logging
import os

import pytest

from common.realtime import ProcessConfig, take_priority


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[tuple[int, int, int]]:
    calls: list[tuple[int, int, int]] = []
    monkeypatch.setattr(
        os, "sched_setscheduler", lambda pid, policy, param: calls.append((pid, policy, param.sched_priority))
    )
    return calls


def test_it_asks_for_fifo_with_the_priority(asked: list[tuple[int, int, int]]) -> None:
    assert take_priority(ProcessConfig(realtime_priority=20))
    assert asked == [(0, os.SCHED_FIFO, 20)]


def test_zero_leaves_the_scheduler_alone(asked: list[tuple[int, int, int]]) -> None:
    assert not take_priority(ProcessConfig())
    assert asked == []


def test_a_refusal_is_told_with_what_to_do(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def refuse(*_: object) -> None:
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    with caplog.at_level(logging.WARNING):
        assert not take_priority(ProcessConfig(realtime_priority=20))
    assert "CAP_SYS_NICE" in caplog.text
