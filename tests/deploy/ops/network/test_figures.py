"""What is made of the probes' notes, and when a link counts as its profile says; on made-up arrivals."""

from __future__ import annotations

from dataclasses import replace
from io import StringIO

import numpy as np
import pytest
from rich.console import Console

from common.errors import NetworkError
from deploy.ops.network.figures import DELAY_MS, LOSS_POINTS, RATE_SHARE, Measured, judge, rate_mbit
from deploy.ops.network.view import measured_table
from deploy.sim.network.profile import Way
from deploy.sim.network.scheduler import PacketScheduler

MS = 1_000_000
STEADY = Way(delay_ms=20.0)


def arrivals(way: Way, count: int, seed: int = 1) -> list[tuple[int, int, int]]:
    """As the scheduler itself would carry packets 5 ms apart."""
    scheduler: PacketScheduler[int] = PacketScheduler(way, seed)
    noted: list[tuple[int, int, int]] = []

    def ask(until_ns: int) -> None:
        while scheduler.next_ns is not None and scheduler.next_ns <= until_ns:
            at_ns = scheduler.next_ns
            noted.extend((number, 5 * MS * number, at_ns) for number in scheduler.due(at_ns))

    for number in range(count):
        ask(5 * MS * number)
        scheduler.push(5 * MS * number, number, 128)
    ask(10**15)
    return noted


def test_a_steady_link() -> None:
    found = judge(STEADY, 100, arrivals(STEADY, 100), 128, 0.5)
    assert (found.mean_ms, found.p50_ms, found.p99_ms, found.jitter_ms) == (20.0, 20.0, 20.0, 0.0)
    assert (found.sent, found.received, found.loss_percent) == (100, 100, 0.0)
    assert found.reordered_percent == found.duplicate_percent == 0.0
    assert found.kept


def test_each_trouble_is_measured_as_it_was_made() -> None:
    way = Way(delay_ms=30.0, loss_percent=4.0, burst_packets=3.0, reorder_percent=2.0, duplicate_percent=1.0)
    found = judge(way, 40_000, arrivals(way, 40_000), 128, 200.0)
    assert found.loss_percent == pytest.approx(4.0, abs=found.loss_bound_percent)
    assert found.reordered_percent == pytest.approx(2.0, abs=0.3)
    assert found.duplicate_percent == pytest.approx(1.0, abs=0.2)
    assert found.expected_ms == pytest.approx(30.0 + 0.02 * 20.0)
    assert found.delay_kept
    assert found.loss_kept


def test_a_slow_link_s_own_time_for_a_packet_is_expected() -> None:
    way = Way(delay_ms=10.0, rate_mbit=1.0)
    found = judge(way, 50, arrivals(way, 50), 128, 0.25)
    assert found.expected_ms == pytest.approx(10.0 + 1.024)
    assert found.delay_off_ms == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("off_ms", [DELAY_MS - 0.01, -DELAY_MS + 0.01, DELAY_MS + 0.01, -DELAY_MS - 0.01])
def test_the_gate_of_the_delay(off_ms: float) -> None:
    late = [(n, sent, received + round(off_ms * MS)) for n, sent, received in arrivals(STEADY, 100)]
    for planned in (None, 20.0):
        assert judge(STEADY, 100, late, 128, 0.5, planned).delay_kept is (abs(off_ms) < DELAY_MS)


def test_with_jitter_chance_is_allowed_for() -> None:
    way = Way(delay_ms=30.0, jitter_ms=10.0)
    found = judge(way, 600, arrivals(way, 600), 128, 3.0)
    assert found.delay_bound_ms > 3.0
    assert replace(found, planned_ms=found.mean_ms + 1.2).delay_kept is False
    assert replace(found, planned_ms=found.mean_ms - 0.9).delay_kept is True
    # drawn wrongly: further from the profile than chance may be
    far_ms = 30.0 + 2.0 * found.delay_bound_ms
    assert replace(found, mean_ms=far_ms, planned_ms=far_ms).delay_kept is False


def test_the_gate_of_loss_and_rate() -> None:
    found = judge(STEADY, 1000, arrivals(STEADY, 1000), 128, 5.0)
    assert found.loss_bound_percent == 0.0
    assert replace(found, loss_percent=LOSS_POINTS).loss_kept
    assert not replace(found, loss_percent=LOSS_POINTS + 0.01).loss_kept
    # what was drawn is not the machine's fault, as long as chance may draw it
    burst = replace(found, loss_percent=2.5, planned_loss_percent=2.5)
    assert not burst.loss_kept
    assert replace(burst, loss_bound_percent=2.6).loss_kept
    assert not replace(burst, loss_bound_percent=2.6, planned_loss_percent=1.9).loss_kept
    for share, kept in ((1.0 - RATE_SHARE + 0.001, True), (1.0 + RATE_SHARE + 0.001, False)):
        filled = replace(found, rate_mbit=8.0 * share, expected_rate_mbit=8.0)
        assert filled.rate_kept is kept
        assert Measured("mine", "forwarder", found, filled).kept is kept


def test_the_rate_is_that_between_the_arrivals() -> None:
    times = np.arange(11) * 10 * MS
    assert rate_mbit([(n, 0, int(at_ns)) for n, at_ns in enumerate(times)], 1250) == pytest.approx(1.0)


def test_nothing_that_arrives_is_an_error() -> None:
    with pytest.raises(NetworkError, match="none of 7 packets came through"):
        judge(STEADY, 7, [], 128, 1.0)


def test_the_table_fits_a_terminal_and_marks_what_is_off() -> None:
    found = judge(
        Way(delay_ms=310.0, loss_percent=0.5, burst_packets=5.0), 100, arrivals(STEADY, 100), 128, 0.5
    )
    good = judge(STEADY, 100, arrivals(STEADY, 100), 128, 0.5)
    off = replace(found, rate_mbit=20.0, expected_rate_mbit=20.0)
    console = Console(width=80, record=True, file=StringIO(), force_terminal=True)
    console.print(measured_table([Measured("intercontinental", "forwarder", off, good)]))
    text = console.export_text(styles=True)
    assert "…" not in text
    assert "\x1b[31m20.00" in text  # the mean that should be 310
    assert text.count("\x1b[31m") == 1
