"""`tandem stops` says what each input tells, and each change of it once."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest

from common.clock import monotonic_ns
from common.errors import TandemError
from deploy.ops.stops import show, stops
from slave.stop_inputs import robot_stops
from slave.stop_inputs.config import EstopConfig, StopInputConfig
from slave.stop_inputs.source import Level

LINE = StopInputConfig(name="red button", source="gpio", line="STOP")


class Tapped:
    """Closed, then open for ten readings."""

    def __init__(self) -> None:
        self.reads = 0
        self.stopped = False

    def start(self) -> None: ...

    def read(self) -> Level:
        self.reads += 1
        now_ns = monotonic_ns()
        return Level(now_ns, 10 <= self.reads < 20)  # pulled up: high is open

    def stop(self) -> None:
        self.stopped = True


def test_each_change_is_said_once(monkeypatch: pytest.MonkeyPatch) -> None:
    source = Tapped()
    monkeypatch.setattr(robot_stops, "source_of", lambda *_: source)
    said: list[str] = []

    class EnoughError(Exception):
        pass

    def say(words: str) -> None:
        said.append(words)
        if len(said) == 4:
            raise EnoughError

    with pytest.raises(EnoughError):
        asyncio.run(show(EstopConfig(inputs=[LINE], settle_s=0.02, silent_s=1.0), None, say))
    assert [words[:4] for words in said] == ["ok  ", "STOP", "STOP", "ok  "]
    assert "pressed, or its wire is broken" in said[1]
    assert "closed for less than 0.02 s" in said[2]
    assert source.stopped


def test_it_ends_after_the_time_it_is_given(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(robot_stops, "source_of", lambda *_: Tapped())
    said: list[str] = []
    asyncio.run(show(EstopConfig(inputs=[LINE]), 0.0, said.append))
    assert len(said) == 1


def test_a_file_without_an_input_of_this_host_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "slave.toml"
    file.write_text('robot = "robot-1"\n[link]\nlisten = ["tcp/127.0.0.1:7447"]\n', "utf-8")
    with pytest.raises(TandemError, match="is this host's own"):
        stops(file)
