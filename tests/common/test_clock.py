"""Times of other clocks, carried over to the one that everything is measured by."""

from __future__ import annotations

import time

import pytest

from common import clock
from common.clock import NS_PER_S, of_driver_ns


def test_a_driver_s_stamp_is_carried_over_to_the_own_clock(monkeypatch: pytest.MonkeyPatch) -> None:
    # two clocks that have run apart by five seconds, as they do within two days at 30 ppm
    monkeypatch.setattr(time, "monotonic_ns", lambda: 100 * NS_PER_S)
    monkeypatch.setattr(clock, "monotonic_ns", lambda: 105 * NS_PER_S)
    assert of_driver_ns(99 * NS_PER_S) == 104 * NS_PER_S
