"""From events to windows: each fault until its own recovery, a soak that was cut short to its end."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from deploy.experiments.soak.files.events import AnyEvent
from deploy.experiments.soak.judge.explain import Explained, explanation, unexplained_lefts
from deploy.experiments.soak.judge.windows import Window
from tests.deploy.experiments.soak.conftest import STORY, Make, happened


def explained(make: Make, *events: AnyEvent) -> Explained:
    return explanation(events, make().samples)


def fault(at_s: float, number: int) -> AnyEvent:
    return happened(at_s, "fault", {"fault": "suit-kill", "number": number})


def test_a_fault_s_window_ends_with_its_own_recovery(make: Make) -> None:
    events = (
        happened(5.0, "follows"), fault(10.0, 0), happened(14.0, "recovered", {"number": 0}), fault(30.0, 1),
        happened(39.0, "recovered", {"number": 1}),
    )  # fmt: skip
    windows = [(w.from_s, w.until_s, w.why) for w in explained(make, *events).faults]
    assert windows == [(0.0, 5.0, "start"), (10.0, 14.0, "suit-kill"), (30.0, 39.0, "suit-kill")]


def test_what_never_ended_lasts(make: Make) -> None:
    assert explained(make).faults[0].until_s == math.inf
    assert explained(make, happened(5.0, "follows"), fault(10.0, 0)).why(1e6) == "suit-kill"


def test_after_a_robot_left_off_what_comes_has_a_reason(make: Make) -> None:
    left = happened(50.0, "left", {"guard": "hold"})
    events = (*STORY[:6], left, happened(53.0, "recovered", {"fault": "", "number": -1}))
    found = explained(make, *events)
    assert found.why(52.0) == "after it left track"
    assert found.why(60.0) == ""
    assert unexplained_lefts(events, found) == [left]


def test_what_is_sent_during_the_stop_counts_for_nothing(make: Make) -> None:
    assert explained(make, *STORY, happened(300.0, "end")).why(301.0) == "end"


@pytest.mark.parametrize(("transport", "enough"), [("tcp", 1), ("tls", 1), ("udp", 3), ("quic-datagram", 3)])
def test_a_network_that_lost_enough_explains_a_hold(make: Make, transport: str, enough: int) -> None:
    begun = happened(0.0, "begin", {"transport": transport})
    events = (begun, *STORY[1:6], happened(50.0, "left", {"guard": "hold"}))

    def lefts(**columns: Any) -> Sequence[AnyEvent]:
        samples = make(**columns).samples
        return unexplained_lefts(events, explanation(events, samples))

    assert len(lefts(link_lost=at(50, enough - 1))) == 1
    assert lefts(link_lost=at(50, enough)) == []
    assert len(lefts(link_lost=at(60, enough))) == 1
    assert lefts(link_out=at(50, enough)) == []
    assert len(lefts(link_odd=at(50, 9))) == 1


@pytest.mark.parametrize("lossy_s", [(), (20.0,), (7.5, 30.5, 9.0)])
def test_times_are_accounted_for_as_single_holds_are(lossy_s: tuple[float, ...]) -> None:
    found = Explained((), (Window(50.0, 50.2, "the host stalled"),), (), lossy_s)
    at_s = np.arange(0.0, 60.0, 0.25)
    assert found.accounted(at_s).tolist() == [found.accounts_for_hold(float(s)) for s in at_s]


def test_the_network_s_windows_are_the_seconds_it_was_active(make: Make) -> None:
    windows = explanation(STORY, make(link_out=at(70, 2)).samples).network
    assert [(w.from_s, w.until_s) for w in windows] == [(69.0, 70.0)]


def at(second: float, value: float) -> Any:
    return lambda at_s: np.where(at_s == second, value, 0.0)
