"""An operator who had pictures and has none any more is not followed; nor one whose picture is old."""

from __future__ import annotations

from typing import Any

from common.clock import to_ns
from slave.guard.body import WELL, Body
from slave.guard.config import GuardConfig
from slave.guard.eyes import REMEDY, video_loss
from slave.guard.states import State
from slave.guard.watchdog import BODY_WATCHES

STALE = Body(video="the operator's newest picture is 3.1 s old, limit 3 s")
LIMIT_S = 3.0
CONFIG = GuardConfig()


def test_a_picture_may_be_as_old_as_the_limit_and_no_older() -> None:
    assert CONFIG.max_video_age_s == LIMIT_S
    assert video_loss(0, to_ns(LIMIT_S), CONFIG) is None
    words = video_loss(0, to_ns(LIMIT_S) + 1, CONFIG)
    assert words == f"the operator's newest picture is 3.0 s old, limit 3 s; {REMEDY}"


def test_an_own_clock_that_went_back_keeps_no_picture_fresh() -> None:
    assert video_loss(to_ns(LIMIT_S) + 1, 0, CONFIG) is not None


def test_who_never_had_a_picture_relies_on_none_and_0_switches_it_off() -> None:
    assert video_loss(None, to_ns(1000.0), CONFIG) is None
    assert video_loss(0, to_ns(1000.0), GuardConfig(max_video_age_s=0.0)) is None


def test_a_stale_picture_holds_and_is_no_reason_once_it_is_fresh(rig: Any) -> None:
    rig.to_track()
    rig.body = STALE
    rig.step()
    assert rig.guard.state is State.HOLD
    assert "picture" in rig.guard.reason
    assert rig.guard.counters.losses == {"video": 1}
    rig.run(0.5)
    assert "picture" in (rig.guard.engage(rig.guard.operator, rig.now_ns) or "")
    rig.body = WELL
    rig.run(0.1)
    assert rig.guard.state is State.HOLD, "fresh is not engaged"
    rig.engage()


def test_without_its_watch_the_robot_would_follow_a_blind_operator(make_rig: Any) -> None:
    watches = tuple(w for w in BODY_WATCHES if w.name != "video")
    rig = make_rig(body_watches=watches).to_track()
    rig.body = STALE
    rig.run(0.5)
    assert rig.guard.state is State.TRACK


def test_who_yields_to_a_push_yields_without_pictures_too(rig: Any) -> None:
    rig.to_track()
    rig.body = STALE
    rig.step()
    assert rig.guard.may_yield(rig.now_ns)
