"""When the demo's operator engages again, what counts against the robot, and when he gives up."""

from __future__ import annotations

import pytest

from common.clock import to_ns
from deploy.harness.excuse import STILL_S, Lost, StallEvidence
from deploy.harness.operator import (
    JUDGED_AFTER_S,
    GuardSight,
    HoldRecord,
    HostLost,
    Operator,
    OperatorPatience,
    UnaskedHold,
)

BACK_S, HOLDS_WITHIN_S = 20.0, 20.0
PATIENCE = OperatorPatience(BACK_S, 3, HOLDS_WITHIN_S)
LATE_S = JUDGED_AFTER_S + 0.1


def lost(still_s: float) -> HostLost:
    return lambda at_ns: Lost(still_s, still_s, StallEvidence.PRIORITY)


def state(at_s: float, guard: str, reason: str = "because") -> GuardSight:
    return GuardSight(to_ns(at_s), guard, reason)


KEPT_ITS_TIME = lost(0.0)


def see(one: Operator, *sights: GuardSight) -> list[UnaskedHold]:
    return [hold for sight in sights for hold in one.see(sight)]


def operator(host_lost: HostLost = KEPT_ITS_TIME) -> Operator:
    """His robot is engaged at 1 s and tracks at 2 s."""
    one = Operator("robot-1", PATIENCE, host_lost=host_lost, again_s=0.25)
    assert see(one, state(0.5, "hold")) == []
    assert one.engages(to_ns(0.5))
    assert see(one, state(1.0, "align"), state(2.0, "track")) == []
    assert one.tracks
    return one


def holds(one: Operator, *at_s: float) -> None:
    """It holds at each, and tracks again half a second later."""
    for t in at_s:
        see(one, state(t, "hold"), state(t + 0.2, "align"), state(t + 0.5, "track"))


def test_a_hold_is_printed_engaged_again_and_kept() -> None:
    one = operator()
    [hold] = see(one, state(6.0, "hold", "no encoder"), state(6.02, "hold", "no encoder"))
    assert "robot-1 holds after 5.0 s: no encoder" in one.words(hold)
    assert one.engages(to_ns(6.02))
    assert see(one, state(6.5, "align"), state(8.0, "track")) == [hold]
    assert "tracks again: out of track for 2.0 s" in one.words(hold)
    assert one.record(hold) == HoldRecord(
        robot="robot-1", at_s=5.0, was="track", reason="no encoder", lasted_s=2.0,
        host_still_ms=0, host="the host kept its time", counts=True,
    )  # fmt: skip


def test_it_engages_only_a_ready_robot_and_waits_between_requests() -> None:
    one = operator()
    assert not one.engages(to_ns(2.5))
    [hold] = see(one, state(3.0, "hold"))
    assert not one.engages(to_ns(3.0), ready=False)
    one.answered(to_ns(3.1), "still braking")
    assert not one.engages(to_ns(3.3))
    assert one.engages(to_ns(3.4))
    one.answered(to_ns(3.5), "")
    assert (one.engaged, one.engaged_ns, one.refused) == (1, to_ns(3.5), "")
    assert (hold.engaged_ns, hold.refused) == (to_ns(3.5), "still braking")


def test_without_patience_he_never_gives_up() -> None:
    one = Operator("robot-1", guard="track")
    holds(one, 1.0, 2.0, 3.0, 4.0)
    see(one, state(5.0, "estop"))
    assert one.gives_up(to_ns(1000.0)) is None
    assert len(one.holds) == 4


def test_an_alignment_that_ends_in_hold_is_a_hold() -> None:
    one = operator()
    see(one, state(3.0, "hold"), state(3.5, "align"), state(4.0, "hold"), state(4.5, "align"))
    assert [(hold.was, hold.tracked_ns) for hold in one.holds] == [("track", None), ("align", None)]
    assert len(see(one, state(5.0, "track"))) == 2
    assert [hold.tracked_ns for hold in one.holds] == [to_ns(5.0)] * 2


@pytest.mark.parametrize(("last_s", "fails"), [(3.0 + HOLDS_WITHIN_S, True), (3.1 + HOLDS_WITHIN_S, False)])
def test_three_holds_within_twenty_seconds_are_too_many(last_s: float, fails: bool) -> None:
    one = operator()
    holds(one, 3.0, 10.0)
    assert one.gives_up(to_ns(22.0)) is None
    holds(one, last_s)
    why = one.gives_up(to_ns(last_s + LATE_S))
    assert (why == "robot-1 held 3 times within 20 s, last: because") is fails


@pytest.mark.parametrize(
    ("found", "counts", "said"),
    [
        (
            Lost(STILL_S, STILL_S, StallEvidence.PRIORITY),
            False,
            "does not count: just before, the host stalled",
        ),
        (Lost(STILL_S, STILL_S, StallEvidence.STEAL), False, "50 ms: /proc/stat shows steal"),
        (
            Lost(STILL_S - 0.001, STILL_S, StallEvidence.STEAL),
            True,
            "counts: just before, the host stalled",
        ),
        (Lost(0.0, 1.0, StallEvidence.NONE), True, "not excused: neither real-time priority nor steal"),
    ],
)
def test_a_hold_counts_unless_the_host_stalled_before_it(found: Lost, counts: bool, said: str) -> None:
    asked: list[int] = []

    def host_lost(at_ns: int) -> Lost:
        asked.append(at_ns)
        return found

    one = operator(host_lost)
    [hold] = see(one, state(2.9, "hold"))
    see(one, state(2.95, "track"))
    assert said in one.words(hold)
    one.holds.clear()
    asked.clear()
    holds(one, 3.0, 4.0, 5.0, 6.0)
    assert (one.gives_up(to_ns(6.0 + LATE_S)) is not None) is counts
    assert asked[0] == to_ns(3.0)
    assert [one.record(hold).counts for hold in one.holds] == [counts] * 4


def test_what_the_host_says_a_second_late_is_waited_for() -> None:
    one = operator()
    holds(one, 3.0, 4.0, 5.0)
    assert one.gives_up(to_ns(5.0 + JUDGED_AFTER_S)) is None
    assert one.gives_up(to_ns(5.0 + LATE_S)) is not None


@pytest.mark.parametrize("still_s", [0.0, 1.0])
def test_a_robot_that_does_not_come_back_is_given_up(still_s: float) -> None:
    one = operator(lost(still_s))
    see(one, state(3.0, "hold", "no command"))
    one.answered(to_ns(3.0), "still braking")
    assert one.gives_up(to_ns(3.0 + BACK_S)) is None
    why = one.gives_up(to_ns(3.1 + BACK_S))
    assert why == "robot-1 did not track for 20 s: hold (no command); asked to engage: still braking"


def test_going_to_and_fro_between_hold_and_align_is_no_way_back() -> None:
    one = operator(lost(1.0))
    see(one, *(state(3.0 + t, guard) for t in range(20) for guard in ("hold", "align")))
    assert one.gives_up(to_ns(3.1 + BACK_S)) is not None


def test_a_robot_unheard_or_stopped_by_a_person_is_given_up() -> None:
    one = Operator("robot-1", PATIENCE, wanted_ns=to_ns(1.0))
    assert one.gives_up(to_ns(1.0 + BACK_S)) is None
    assert one.gives_up(to_ns(1.1 + BACK_S)) == "robot-1 did not track for 20 s: silent (not heard)"
    one = operator()
    see(one, state(3.0, "estop", "e-stop by visitor"))
    assert one.gives_up(to_ns(3.0)) == "robot-1 is in estop: e-stop by visitor"
    assert not one.engages(to_ns(3.0))
