"""From events to windows: each fault until its own recovery, a soak that was cut short to its end."""

from __future__ import annotations

import math

from deploy.soak.events import Event
from deploy.soak.explain import explanation, unexplained_lefts

from .conftest import STORY


def fault(at_s: float, number: int) -> Event:
    return Event(at_s, "fault", {"fault": "suit-kill", "number": number})


def test_a_fault_s_window_ends_with_its_own_recovery() -> None:
    events = (
        Event(5.0, "follows"), fault(10.0, 0), Event(14.0, "recovered", {"number": 0}), fault(30.0, 1),
        Event(39.0, "recovered", {"number": 1}),
    )  # fmt: skip
    windows = [(w.from_s, w.until_s, w.why) for w in explanation(events).faults]
    assert windows == [(0.0, 5.0, "start"), (10.0, 14.0, "suit-kill"), (30.0, 39.0, "suit-kill")]


def test_what_never_ended_lasts() -> None:
    assert explanation(()).faults[0].until_s == math.inf
    assert explanation((Event(5.0, "follows"), fault(10.0, 0))).why(1e6) == "suit-kill"


def test_what_comes_after_a_robot_left_off_has_a_reason_that_it_left_has_none() -> None:
    left = Event(50.0, "left", {"guard": "hold"})
    events = (*STORY[:6], left, Event(53.0, "recovered", {"fault": "", "number": -1}))
    explained = explanation(events)
    assert explained.why(52.0) == "after it left off"
    assert explained.why(60.0) == ""
    assert unexplained_lefts(events, explained) == [left]


def test_what_the_processes_say_while_they_are_stopped_counts_for_nothing() -> None:
    assert explanation((*STORY, Event(300.0, "end"))).why(301.0) == "end"
