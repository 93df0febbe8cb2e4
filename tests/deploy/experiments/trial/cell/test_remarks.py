from __future__ import annotations

from common.clock import to_ns
from deploy.experiments.trial.cell.remarks import hold_remarks
from deploy.harness.operator import UnaskedHold

BEGAN_NS = to_ns(100.0)


def hold(began_s: float, engaged_s: float | None, refused: str = "") -> UnaskedHold:
    engaged_ns = None if engaged_s is None else BEGAN_NS + to_ns(engaged_s)
    reason = "no command for 0.2 s"
    return UnaskedHold("robot-1", BEGAN_NS + to_ns(began_s), "track", reason, engaged_ns, refused)


def test_a_hold_and_the_next_engagement_are_noted_with_times() -> None:
    assert hold_remarks([hold(2.0, 2.25), hold(5.0, None)], BEGAN_NS) == [
        "at 2.0 s the robot held: no command for 0.2 s",
        "at 2.2 s the operator engaged again",
        "at 5.0 s the robot held: no command for 0.2 s",
    ]


def test_a_refusal_is_remarked_where_it_lasted() -> None:
    refused = "the deadman is released"
    assert not any("refused" in words for words in hold_remarks([hold(2.0, 2.5, refused)], BEGAN_NS))
    assert hold_remarks([hold(2.0, 6.0, refused)], BEGAN_NS)[1:] == [
        "at 2.0 s engage was refused: the deadman is released",
        "at 6.0 s the operator engaged again",
    ]
    [_, last] = hold_remarks([hold(2.0, None, refused)], BEGAN_NS)
    assert "engage was refused" in last


def test_a_hold_just_before_the_judged_time_is_at_its_beginning() -> None:
    assert hold_remarks([hold(-0.3, None)], BEGAN_NS) == ["at 0.0 s the robot held: no command for 0.2 s"]
