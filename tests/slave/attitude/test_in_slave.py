"""The slave's loop with a base: what it publishes, and that a tilted or silent one is something amiss."""

from __future__ import annotations

import asyncio
import math
from collections.abc import AsyncIterator, Callable
from typing import Any

import numpy as np
import pytest

from common.link.config import LinkConfig
from common.metrics.slave import ServoMetrics, SlaveMetrics
from common.process.pacing import DueTick, TickGrid
from common.wire.codec import decode
from common.wire.messages import BaseAttitude, RobotState
from common.wire.topics import Topic
from slave import app
from slave.config import SlaveConfig
from slave.servos import EncoderReading

NOW_NS = 10_000_000_000


class FakeLink:
    paths = ""

    def __init__(self) -> None:
        self.states: list[bytes] = []

    def publish(self, topic: Topic) -> Callable[[bytes], None]:
        return self.states.append if topic.name == "state" else lambda _: None

    def subscribe_keys(self, *_: object) -> None: ...

    def answer(self, *_: object) -> None: ...

    def answer_keys(self, *_: object) -> None: ...

    def watch_presence(self, *_: object) -> None: ...

    def counters(self) -> dict[str, int]:
        return {}


class StillServos:
    def faults(self) -> dict[str, str]:
        return {"neck_yaw": "over-current"}

    def read(self) -> EncoderReading:
        return EncoderReading(NOW_NS, np.zeros(25, np.int64), np.ones(25, np.bool_))

    def write(self, _: object) -> None: ...

    def metrics(self) -> ServoMetrics:
        return ServoMetrics()


class FakeBase:
    def __init__(self, attitude: BaseAttitude | None) -> None:
        self._attitude = attitude

    def read(self) -> BaseAttitude | None:
        return self._attitude

    def counters(self) -> dict[str, int]:
        return {"frames": 7}


def state_with(base: Any, monkeypatch: pytest.MonkeyPatch) -> tuple[RobotState, SlaveMetrics]:
    async def four_ticks(grid: TickGrid) -> AsyncIterator[DueTick]:
        for tick in range(4):
            yield DueTick(tick, grid.origin_ns, 0)

    monkeypatch.setattr(app, "ticks", four_ticks)
    monkeypatch.setattr(app, "monotonic_ns", lambda: NOW_NS)
    link: Any = FakeLink()
    servos: Any = StillServos()
    config = SlaveConfig(robot="robot-1", link=LinkConfig(listen=["tcp/127.0.0.1:7447"]))
    slave = app.Slave(config, link, servos, base)
    asyncio.run(slave._drive())
    return decode(link.states[-1], RobotState, 25), slave.metrics()


def attitude(tilt_deg: float, age_s: float = 0.0) -> BaseAttitude:
    return BaseAttitude(NOW_NS - round(age_s * 1e9), 1.5, None, 0.1, math.radians(tilt_deg))


def test_without_a_sensor_nothing_is_told_and_nothing_amiss(monkeypatch: pytest.MonkeyPatch) -> None:
    state, metrics = state_with(None, monkeypatch)
    assert state.base is None
    assert "base" not in state.faults
    assert metrics.base == {}


def test_a_level_base_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    state, metrics = state_with(FakeBase(attitude(1.0)), monkeypatch)
    assert state.base == attitude(1.0)
    assert state.faults["neck_yaw"] == "over-current"
    assert "base" not in state.faults
    assert metrics.base == {"frames": 7}


@pytest.mark.parametrize(
    ("base", "words"),
    [(attitude(12.0), "tilts by 12.0°"), (attitude(0.0, age_s=0.6), "silent"), (None, "not answered")],
)
def test_a_base_that_tilts_or_is_silent_is_amiss(
    base: BaseAttitude | None, words: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    state, _ = state_with(FakeBase(base), monkeypatch)
    assert words in state.faults["base"]
    assert "neck_yaw" in state.faults
