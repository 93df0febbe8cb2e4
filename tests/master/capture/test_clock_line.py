"""Sample times from arrivals that vary, and from own times and counts that wrap and begin anew."""

from __future__ import annotations

import math

import numpy as np
import pytest

from common.quaternion import Array
from master.capture.clock_line import ClockLines, NodeLine

NONE, STAMP, COUNT = "none", "stamp", "count"


class Node:
    """One node at 100 Hz whose clock runs fast; each arrival is late by 0.2 ms and some more."""

    def __init__(self, kind: str, wrap: float = 0.0, rate_hz: float = np.nan, ppm: float = 100.0) -> None:
        self.kind, self.wrap, self.ppm = kind, wrap, ppm
        zero, ours = np.zeros(1), np.array([wrap])
        self.lines = ClockLines(
            ours if kind == STAMP else zero, ours if kind == COUNT else zero, np.array([1.0 / rate_hz])
        )
        self.random = np.random.default_rng(1)
        self.own = 0

    def true_s(self, index: Array) -> Array:
        out: Array = 5.0 + 0.01 * index * (1.0 - 1e-6 * self.ppm)
        return out

    def arrive(self, index: int, at_s: float | None = None, own: int | None = None) -> float:
        """The time that is found for the sample of that index."""
        own = index if own is None else own
        true_s = float(self.true_s(np.array(index)))
        at_s = true_s + 2e-4 + self.random.exponential(3e-4) if at_s is None else at_s
        stamp, count = 0.01 * own % self.wrap if self.wrap else 0.0, own % (self.wrap or 1)
        return self.lines.take([0], [at_s], [stamp], [count])[0]

    def run(self, first: int, last: int, lose: float = 0.0) -> Array:
        """Errors of the times of many samples, s."""
        out = []
        for index in range(first, last):
            if self.random.random() >= lose:
                out.append(self.arrive(index) - float(self.true_s(np.array(index))))
        return np.array(out)


@pytest.mark.parametrize(("kind", "wrap"), [(NONE, 0.0), (STAMP, 0.64), (COUNT, 256.0)])
def test_times_are_right_to_half_a_millisecond_with_drift_jitter_and_loss(kind: str, wrap: float) -> None:
    node = Node(kind, wrap)
    error = node.run(0, 2000, lose=0.01)[300:]
    # 0.2 ms of it is the least delay, which nobody can know
    assert error.min() >= 0.0
    assert error.max() <= 8e-4
    assert node.lines.period_s[0] == pytest.approx(0.01, rel=0.01)
    assert 5 <= node.lines.missing[0] <= 40


@pytest.mark.parametrize(("kind", "wrap"), [(NONE, 0.0), (STAMP, 6.4), (COUNT, 256.0)])
def test_what_a_stall_held_back_keeps_its_times(kind: str, wrap: float) -> None:
    node = Node(kind, wrap)
    node.run(0, 400)
    last = float(node.true_s(np.array(405)))
    zero = np.arange(400.0, 406.0)
    stamps: Array = 0.01 * zero % (node.wrap or 1.0)
    counts: Array = zero % (node.wrap or 1.0)
    times = np.array(node.lines.take([0] * 6, [last + 2e-4] * 6, stamps.tolist(), counts.tolist()))
    assert np.abs(times - node.true_s(zero)).max() <= 1.5e-3


def test_a_repeated_frame_is_no_second_sample() -> None:
    node = Node(COUNT, 256.0, rate_hz=100.0)
    node.run(0, 50)
    assert np.isnan(node.arrive(49))
    assert node.lines.duplicates[0] == 1


@pytest.mark.parametrize(("kind", "wrap"), [(STAMP, 4.2e9), (COUNT, 65536.0)])
def test_a_node_that_begins_anew_is_followed_at_once(kind: str, wrap: float) -> None:
    node = Node(kind, wrap)
    node.run(0, 300)
    found = [
        node.arrive(index, own=index - 300) - float(node.true_s(np.array(index))) for index in range(300, 350)
    ]
    assert np.abs(found).max() <= 4e-3
    assert node.lines.resets[0] == 1


def test_a_wrap_is_no_reset() -> None:
    node = Node(COUNT, 16.0)
    node.run(0, 500)
    assert node.lines.resets[0] == 0
    assert node.lines.missing[0] == 0


def test_the_line_comes_down_to_an_earlier_arrival_at_once() -> None:
    """Without it a node whose first frames were late would stay late for seconds."""
    node = Node(COUNT, 256.0, rate_hz=100.0, ppm=0.0)
    for index in range(20):
        node.arrive(index, at_s=float(node.true_s(np.array(index))) + 0.008)
    true_s = float(node.true_s(np.array(20)))
    assert node.arrive(20, at_s=true_s + 2e-4) == pytest.approx(true_s + 2e-4, abs=1e-9)


@pytest.mark.parametrize("kind", [NONE, COUNT])
def test_samples_that_were_held_back_until_one_instant_teach_no_period(kind: str) -> None:
    """They taught a period of 0, by which the next sample was divided."""
    node = Node(kind, 256.0)
    held = np.arange(30.0).tolist()
    node.lines.take([0] * 30, [5.0] * 30, held, held)
    assert np.isnan(node.lines.period_s[0])
    node.run(30, 200)
    assert node.lines.period_s[0] == pytest.approx(0.01, rel=0.02)


@pytest.mark.parametrize(("kind", "wrap"), [(STAMP, np.inf), (COUNT, 2.0**32)])
@pytest.mark.parametrize("garbage", [np.nan, np.inf])
def test_an_own_time_that_is_no_number_spoils_its_sample_alone(
    kind: str, wrap: float, garbage: float
) -> None:
    node = Node(kind, wrap, rate_hz=100.0)
    node.run(0, 300)
    true_s = float(node.true_s(np.array(300)))
    found = node.lines.take([0], [true_s + 2e-4], [garbage], [garbage])
    assert found[0] == pytest.approx(true_s, abs=5e-3)
    assert np.abs(node.run(301, 1500)[600:]).max() <= 1e-3


def throttled(
    rate_hz: float, kind: str = COUNT, wrap: float = 256.0, seconds: float = 10.0, lose: float = 0.0
) -> tuple[Node, Array]:
    """100 Hz for 10 s, then another rate; errors of the sample times from then on."""
    node, errors, true_s = Node(kind, wrap, ppm=0.0), [], 5.0
    for index in range(1000 + round(seconds * rate_hz)):
        if node.random.random() < lose:
            errors.append(0.0)
            true_s += 0.01 if index < 1000 else 1.0 / rate_hz
            continue
        at_s = true_s + 2e-4 + node.random.exponential(3e-4)
        errors.append(node.arrive(index, at_s) - true_s)
        true_s += 0.01 if index < 1000 else 1.0 / rate_hz
    return node, np.array(errors[1000:])


@pytest.mark.parametrize("wrap", [256.0, 65536.0])
@pytest.mark.parametrize("rate_hz", [20.0, 50.0, 80.0, 93.0, 120.0, 200.0])
def test_a_node_that_counts_and_changes_its_rate_is_learnt_again(rate_hz: float, wrap: float) -> None:
    """An IMU that is throttled; by its count alone its samples would seem up to 0.25 s older."""
    node, error = throttled(rate_hz, wrap=wrap)
    assert np.abs(error).max() <= 0.25, "for a while they do"
    assert np.abs(error[100:]).max() < 2e-3
    assert node.lines.rate_changes[0] + node.lines.resets[0] >= (rate_hz < 100.0)
    assert node.lines.period_s[0] == pytest.approx(1.0 / rate_hz, rel=0.02)


@pytest.mark.parametrize("lose", [0.0, 0.02])
@pytest.mark.parametrize("rate_hz", [20.0, 50.0, 80.0, 93.0, 96.0, 99.0, 101.0, 108.0, 120.0, 200.0])
def test_a_node_that_only_samples_and_changes_its_rate_is_learnt_again(rate_hz: float, lose: float) -> None:
    """By its old period samples would be taken for lost, and times be off by up to half a period for ever."""
    node, error = throttled(rate_hz, NONE, 0.0, lose=lose)
    assert np.abs(error).max() <= 6e-3
    assert np.percentile(np.abs(error[-round(3.0 * rate_hz) :]), 99.0) < 2e-3
    assert node.lines.period_s[0] == pytest.approx(1.0 / rate_hz, rel=0.02)
    assert node.lines.resets[0] == 0
    # what was taken for lost until then: one of two at half the rate, for two windows
    assert node.lines.missing[0] <= 250 + 2.0 * lose * (1000 + 10 * rate_hz)


@pytest.mark.parametrize(("rate_hz", "changes"), [(98.5, 1), (99.5, 0)])
def test_a_step_that_differs_by_less_than_a_hundredth_is_no_other_rate(rate_hz: float, changes: int) -> None:
    node, _ = throttled(rate_hz, NONE, 0.0)
    assert node.lines.rate_changes[0] == changes


@pytest.mark.parametrize("rate_hz", [96.0, 98.0])
def test_a_counting_node_that_is_slower_by_some_hundredths_grows_no_age_for_ever(rate_hz: float) -> None:
    """Less than two windows tell, more than a crystal drifts: it stayed 80 ms too old."""
    _, error = throttled(rate_hz, seconds=40.0)
    assert np.abs(error[-round(5.0 * rate_hz) :]).max() < 5e-3


@pytest.mark.parametrize("kind", [NONE, COUNT])
def test_no_jitter_stall_or_loss_is_a_change_of_rate(kind: str) -> None:
    node = Node(kind, 256.0)
    node.run(0, 1000, lose=0.05)
    for first in range(1000, 4000, 100):
        # every second something stands still for 120 ms, and gives all at once
        end_s = float(node.true_s(np.array(first + 12))) + 3e-4
        own = [float(index % 256) for index in range(first, first + 12)]
        node.lines.take([0] * 12, [end_s] * 12, [0.0] * 12, own)
        node.run(first + 12, first + 100)
    assert node.lines.rate_changes[0] == 0
    assert node.lines.resets[0] == 0


@pytest.mark.parametrize(("kind", "wrap"), [(COUNT, 256.0), (COUNT, 65536.0), (STAMP, 6.4), (STAMP, np.inf)])
def test_a_sample_that_was_overtaken_is_left_out_and_no_reset(kind: str, wrap: float) -> None:
    """Some CAN controllers hand over frames of two mailboxes in the wrong order."""
    node = Node(kind, wrap)
    node.run(0, 500)
    both_s = float(node.true_s(np.array(501))) + 3e-4
    assert np.isfinite(node.arrive(501, both_s))
    assert np.isnan(node.arrive(500, both_s))
    error = node.run(502, 1000)
    assert error.max() <= 1e-3
    assert node.lines.overtaken[0] == 1
    assert node.lines.resets[0] == 0


@pytest.mark.parametrize(("kind", "wrap"), [(STAMP, 4.2e9), (COUNT, 65536.0)])
@pytest.mark.parametrize("last", [3, 7])
def test_a_node_that_begins_anew_twice_in_a_row_loses_one_sample(kind: str, wrap: float, last: int) -> None:
    """Its supply dips: what it counted is so near to 0 that its first new sample looks overtaken."""
    node = Node(kind, wrap)
    node.run(0, 500)
    for index in range(500, 500 + last + 1):
        node.arrive(index, own=index - 500)
    again = 501 + last
    found = [node.arrive(index, own=index - again) for index in range(again, again + 50)]
    true_s = node.true_s(np.arange(again, again + 50, dtype=np.float64))
    assert np.isnan(found).sum() <= 2
    assert np.nanmax(np.abs(np.array(found) - true_s)[5:]) < 2e-3


@pytest.mark.parametrize("seed", range(8))
def test_the_samples_of_a_quick_counting_node_are_not_too_old_in_its_first_seconds(seed: int) -> None:
    random, rate_hz = np.random.default_rng(seed), 400.0
    line = NodeLine(0.0, 65536.0, math.nan)
    late_s = []
    for count in range(1200):
        sampled_s = 1.0 + count / rate_hz
        arrived_s = sampled_s + 0.0002 + random.exponential(0.0006)
        if random.random() >= 0.01:
            late_s.append(sampled_s - line.take(arrived_s, float(count), arrived_s, 0))
    assert max(late_s) < 0.004
