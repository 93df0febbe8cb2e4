"""A running master's suit at its tap: the same sweeps as at the bus, also where messages are missed."""

from __future__ import annotations

from copy import deepcopy

import numpy as np
import pytest

from common.errors import RecordingError
from deploy.calibrate.capture import open_source
from deploy.calibrate.live.tapped import TappedSuit
from master.journal.calls import FRAMES
from master.suit.sweep import Sweep
from tests.deploy.recorded.test_recompute import TROUBLES, RecordedBench


def polled(monkeypatch: pytest.MonkeyPatch, bench: RecordedBench, ticks: int) -> list[Sweep]:
    """What the master's own poll gave."""
    own: list[Sweep] = []
    close = bench.raw.poll.close_window

    def closing(now_ns: int) -> Sweep:
        sweep = close(now_ns)
        own.append(deepcopy(sweep))
        return sweep

    monkeypatch.setattr(bench.raw.poll, "close_window", closing)
    bench.run(ticks)
    bench.calls.flush()
    return own


def tapped(bench: RecordedBench, without: slice = slice(0, 0)) -> list[Sweep]:
    heard: list[Sweep] = []
    suit = TappedSuit(open_source(bench.config), heard.append)
    messages = [entry.payload for entry in bench.entries if entry.topic == FRAMES]
    del messages[without]
    for message in messages:
        suit.take(message)
    return heard


def same(one: Sweep, other: Sweep) -> bool:
    names = ("acc_m_s2", "gyr_rad_s", "mag_ut", "fresh")
    return (one.tick, one.sampled_ns) == (other.tick, other.sampled_ns) and all(
        np.array_equal(getattr(one, name), getattr(other, name), equal_nan=name == "mag_ut") for name in names
    )


def test_the_sweeps_are_those_of_the_masters_own_poll(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = RecordedBench(*TROUBLES)
    own = polled(monkeypatch, bench, 400)
    heard = tapped(bench)
    assert len(heard) >= len(own) - 1 > 380
    assert not own[-1].fresh.all() or any(not sweep.fresh.all() for sweep in own)
    assert all(same(one, other) for one, other in zip(heard, own, strict=False))


def test_a_missed_message_costs_its_own_ticks_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = RecordedBench()
    own = {sweep.tick: sweep for sweep in polled(monkeypatch, bench, 300)}
    heard = tapped(bench, slice(100, 140))
    ticks = [sweep.tick for sweep in heard]
    assert ticks == sorted(set(ticks))
    assert len(heard) in range(len(own) - 41, len(own) - 38)
    after = [sweep for sweep in heard if sweep.tick > ticks[101]]
    assert after
    assert all(same(sweep, own[sweep.tick]) for sweep in after)


def test_what_is_no_message_of_frames_is_said() -> None:
    suit = TappedSuit(open_source(RecordedBench().config), lambda _: None)
    with pytest.raises(RecordingError, match="cannot be read"):
        suit.take(b"\xc1")
