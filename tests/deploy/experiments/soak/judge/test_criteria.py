"""Each criterion at its boundary: what a fault explains does not count, what nothing explains does."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from common.config.load import load_config
from deploy.examples.profiles import example
from deploy.experiments.soak.faults import FAULTS, SUIT_LOST_S
from deploy.experiments.soak.files.events import AnyEvent, SoakEvent
from deploy.experiments.soak.files.happenings import SoakBegun
from deploy.experiments.soak.judge.commands import AGE_MS
from deploy.experiments.soak.judge.evidence import of_enough
from deploy.experiments.soak.judge.judge import WRONG, verdicts_of
from deploy.experiments.soak.judge.robot import HOLD_S, STANDS_S, STRAYS_DEG, TRACK_S
from deploy.experiments.soak.judge.windows import AFTER_S
from deploy.experiments.soak.link import nature
from deploy.measure.verdict import Outcome, Verdict, at_most
from deploy.sim.network import load_profile
from master.config import MasterConfig
from tests.deploy.experiments.soak.conftest import RECOVERED, STORY, Make, happened


def judged(seen: Any) -> dict[str, Verdict]:
    return {f"{v.group}: {v.name}": v for v in verdicts_of(seen, WRONG)}


def failing(seen: Any) -> set[str]:
    return {name for name, verdict in judged(seen).items() if verdict.outcome is Outcome.FAILED}


def at(second: float, value: float = 1.0) -> Any:
    """A column that is `value` in the row of that second, and 0 elsewhere."""
    return lambda at_s: np.where(at_s == second, value, 0.0)


def retold(**changes: Any) -> tuple[AnyEvent, ...]:
    return tuple(
        happened(e.at_s, "recovered", {**RECOVERED, **changes}) if e.what.kind == "recovered" else e
        for e in STORY
    )


def without(events: Sequence[AnyEvent], kind: str, index: int = 0) -> tuple[AnyEvent, ...]:
    found = [event for event in events if event.what.kind == kind][index]
    return tuple(event for event in events if event is not found)


def test_a_soak_in_which_nothing_went_wrong_fails_nothing(make: Make) -> None:
    assert failing(make()) == set()


@pytest.mark.parametrize(
    ("column", "name"),
    [
        ("lost", "commands: lost, unexplained"),
        ("late", "commands: out of order, unexplained"),
        ("repeated", "commands: duplicated, unexplained"),
        ("refused", "commands: refused by the guard, unexplained"),
        ("gone", "commands: due but never arrived, unexplained"),
        ("times_lost", "loops: times the master lost the robot, unexplained"),
    ],
)
def test_an_unexplained_hold_fails_and_one_in_a_fault_does_not(make: Make, column: str, name: str) -> None:
    assert failing(make(**{column: at(50)})) == {name}
    assert failing(make(**{column: at(103)})) == set()
    assert failing(make(**{column: at(109.0 + int(AFTER_S))})) == set()
    assert failing(make(**{column: at(109.0 + int(AFTER_S) + 1)})) == {name}


def test_a_network_that_lost_packets_explains_what_was_lost_then(make: Make) -> None:
    for what in ("link_lost", "link_out", "link_odd"):
        assert failing(make(lost=at(51), **{what: at(50)})) == set()
        assert failing(make(lost=at(60), **{what: at(50)})) == {"commands: lost, unexplained"}


@pytest.mark.parametrize(("packets", "lost", "fails"), [(1, 1, False), (1, 2, True), (3, 3, False)])
def test_a_datagram_that_the_network_lost_explains_one_command(
    make: Make, packets: int, lost: int, fails: bool
) -> None:
    def failing_over(transport: str) -> set[str]:
        events = (happened(0.0, "begin", {"transport": transport}), *STORY[1:])
        # long before, and again in a fault, it lost many: those are of other stretches, or of the fault
        gone = lambda at_s: np.select([at_s == 50, at_s == 30], [packets, 40], 0.0)  # noqa: E731
        gone_of = lambda at_s: np.select([at_s == 51, at_s == 103], [lost, 50], 0.0)  # noqa: E731
        return failing(make(events=events, link_lost=gone, lost=gone_of))

    assert failing_over("udp") == ({"commands: lost, unexplained"} if fails else set())
    assert failing_over("tcp") == set()


@pytest.mark.parametrize(("every_s", "judges"), [(6, True), (5, False)])
def test_with_little_unexplained_nothing_lost_is_no_pass(make: Make, every_s: int, judges: bool) -> None:
    def outcome(name: str, **columns: Any) -> Outcome:
        return judged(make(**columns))[name].outcome

    lossy = lambda at_s: np.where(at_s % every_s == 0, 1.0, 0.0)  # noqa: E731
    as_judged = Outcome.PASSED if judges else Outcome.NOT_JUDGED
    assert outcome("commands: out of order, unexplained", link_lost=lossy) is as_judged
    every_second = outcome("guard: unexplained holds", link_lost=1.0)
    assert (every_second, outcome("guard: unexplained holds")) == (
        Outcome.NOT_JUDGED,
        Outcome.PASSED,
    )


@pytest.mark.parametrize(("share", "outcome"), [(0.2, Outcome.PASSED), (0.199, Outcome.NOT_JUDGED)])
def test_a_fifth_unexplained_suffices_to_pass_and_none_to_fail(share: float, outcome: Outcome) -> None:
    assert of_enough(at_most("lost", 0.0, 0.0), share).outcome is outcome
    assert of_enough(at_most("lost", 1.0, 0.0), share).outcome is Outcome.FAILED


def test_a_network_s_delay_is_allowed_for(make: Make) -> None:
    begun = happened(0.0, "begin", {"network": {"name": "4g", "way_s": 0.1}})
    assert judged(make(events=(begun, *STORY[1:])))["guard: slowest hold after a fault"].limit == HOLD_S + 0.1


def test_a_hold_on_a_gentle_fault_may_be_the_network_s(make: Make) -> None:
    gentle = retold(holds=False, held_s=0.3)
    assert failing(make(events=gentle)) == {"guard: holds on a fault that requires none"}
    assert failing(make(events=gentle, link_lost=at(101))) == set()


def test_a_stall_of_the_host_explains_too_if_it_is_long_enough(make: Make) -> None:
    def failing_with(still_ms: float, **shown: float) -> set[str]:
        events = (*STORY, happened(50.0, "still", {"from_s": 49.3, "still_ms": still_ms, **shown}))
        return failing(make(events=events, lost=at(50)))

    assert failing_with(50.0, excused_ms=50.0) == set()
    assert failing_with(49.0, excused_ms=49.0) == {"commands: lost, unexplained"}
    # a stall that may be of tandem's own load: as long as one likes, it excuses only what was stolen
    assert failing_with(500.0, excused_ms=0.0) == failing_with(500.0) == {"commands: lost, unexplained"}
    assert failing_with(500.0, excused_ms=49.0) == {"commands: lost, unexplained"}
    assert failing_with(500.0, excused_ms=50.0) == set()


def test_a_command_that_was_acted_on_too_late_fails_whenever_it_was(make: Make) -> None:
    assert failing(make(age_max_ms=at(103, AGE_MS))) == set()
    assert failing(make(age_max_ms=at(103, AGE_MS + 1.0))) == {"commands: oldest accepted command"}


def test_over_a_long_line_commands_may_be_as_old_as_its_guard_permits(make: Make) -> None:
    network = nature(load_profile("geo-satellite"))
    limit_s = network.max_age_s
    assert limit_s is not None
    assert limit_s > 0.5
    far = (SoakEvent(0.0, SoakBegun(network=network)), *STORY[1:])
    name = "commands: oldest accepted command"
    assert failing(make(events=far, age_max_ms=at(50, 1e3 * limit_s))) == set()
    assert failing(make(events=far, age_max_ms=at(50, 1e3 * limit_s + 1.0))) == {name}
    assert nature(load_profile("4g")).max_age_s == AGE_MS / 1e3


@pytest.mark.parametrize(
    ("key", "limit", "name"),
    [
        ("held_s", HOLD_S, "guard: slowest hold after a fault"),
        ("stands_s", STANDS_S, "guard: slowest standstill after a fault"),
        ("flow_s", 15.0, "recovery: commands flow again after master-kill"),
        ("track_s", TRACK_S, "recovery: slowest return to track once engaged"),
    ],
)
def test_times_after_a_fault_are_judged_at_their_limits(
    make: Make, key: str, limit: float, name: str
) -> None:
    assert failing(make(events=retold(**{key: limit}))) == set()
    assert failing(make(events=retold(**{key: limit + 0.001}))) == {name}


def test_a_stall_of_the_host_is_taken_off_what_the_robot_took(make: Make) -> None:
    slow = retold(held_s=HOLD_S + 0.1)
    inside = happened(101.0, "still", {"from_s": 100.1, "still_ms": 120.0, "excused_ms": 120.0})
    before = happened(99.0, "still", {"from_s": 99.0, "still_ms": 120.0, "excused_ms": 120.0})
    assert failing(make(events=(*slow, inside))) == set()
    assert failing(make(events=(*slow, before))) == {"guard: slowest hold after a fault"}


def test_what_the_master_needs_to_see_a_fault_is_no_time_of_the_robot(make: Make) -> None:
    def suit_kill(held_s: float) -> tuple[AnyEvent, ...]:
        asked = FAULTS["suit-kill"].course(0, 100.0)
        return retold(held_s=held_s, notices_s=asked.notices_s, holds=asked.holds, heard=asked.heard)

    assert failing(make(events=suit_kill(SUIT_LOST_S + HOLD_S))) == set()
    assert failing(make(events=suit_kill(SUIT_LOST_S + HOLD_S + 0.001))) == {
        "guard: slowest hold after a fault"
    }


def test_a_suit_that_is_taken_for_lost_sooner_or_later_is_allowed_for() -> None:
    capture = load_config(example("master"), MasterConfig).capture
    assert capture.lost_after / capture.rate_hz == pytest.approx(SUIT_LOST_S)


@pytest.mark.parametrize("key", ["held_s", "stands_s", "flow_s"])
def test_what_should_have_come_and_did_not_fails(make: Make, key: str) -> None:
    assert len(failing(make(events=retold(**{key: None})))) == 1


def test_a_robot_that_never_came_back_fails(make: Make) -> None:
    assert failing(make(events=retold(done=False))) == {"recovery: faults without recovery"}


def test_a_fault_that_could_not_be_brought_about_fails(make: Make) -> None:
    seen = make(events=retold(failed="the suit does not take its faults"))
    assert failing(seen) == {"recovery: faults that could not be brought about"}


def test_a_move_without_an_engagement_fails(make: Make) -> None:
    assert failing(make(events=without(STORY, "engage", 1))) == {"guard: moves without being engaged"}
    refused = tuple(happened(e.at_s, "engage") if e.at_s == 106.0 else e for e in STORY)
    assert failing(make(events=refused)) == {"guard: moves without being engaged"}


def test_an_engagement_that_led_to_nothing_excuses_no_later_move(make: Make) -> None:
    def moved(engaged_s: float) -> set[str]:
        engaged = happened(engaged_s, "engage", {"done": True})
        return failing(
            make(events=(*STORY, engaged, happened(300.0, "guard", {"from": "hold", "to": "align"})))
        )

    wrong = {"guard: moves without being engaged"}
    assert moved(297.9) == wrong
    assert moved(298.0) == moved(301.0) == set()
    assert moved(301.1) == wrong


def test_how_much_of_all_is_explained_stands_beside_the_figure(make: Make) -> None:
    note = judged(make(lost=at(103)))["commands: lost, unexplained"].why
    assert note.startswith("1 in all; 7262 of 7500 were sent outside of faults and stalls")


def test_a_joint_that_moves_while_the_robot_holds_fails(make: Make) -> None:
    assert failing(make(strayed_deg=at(103, STRAYS_DEG))) == set()
    assert failing(make(strayed_deg=at(103, STRAYS_DEG + 0.1))) == {"guard: moved while it held"}


def test_a_hold_between_faults_fails_unless_the_host_stood_still(make: Make) -> None:
    left = (
        *STORY,
        happened(200.0, "left", {"guard": "hold", "reason": "no command"}),
        happened(203.0, "recovered", {"fault": "", "done": True}),
    )
    assert failing(make(events=left)) == {"guard: unexplained holds"}
    still = happened(199.9, "still", {"from_s": 199.6, "still_ms": 250.0, "excused_ms": 250.0})
    assert failing(make(events=(*left, still))) == set()


def test_a_hold_on_a_fault_that_asks_for_none_fails(make: Make) -> None:
    seen = make(events=retold(holds=False, held_s=0.2))
    assert failing(seen) == {"guard: holds on a fault that requires none"}


def test_missed_ticks_are_judged_without_those_of_the_host(make: Make) -> None:
    # 491 rows outside of windows, 200 ticks each: 98 is just below one in a thousand
    name = "loops: ticks the master missed, unexplained"
    ticks = judged(make())[name]
    assert ticks.measured == 0.0
    assert failing(make(master_missed=at(50, 50.0))) == set()
    assert failing(make(master_missed=at(50, 500.0))) == {name}
    assert failing(make(master_missed=at(50, 500.0), host_still_ms=at(50, 12.0))) == set()
    assert failing(make(master_missed=at(103, 500.0))) == set()


def test_a_process_that_ends_by_itself_fails(make: Make) -> None:
    ended = (*STORY, happened(300.0, "ended", {"process": "suit", "words": "a bug"}))
    assert failing(make(events=ended)) == {"loops: processes that ended by themselves"}


@pytest.mark.parametrize(
    ("what", "wrong"),
    [
        ({"after": "kill", "readable": True, "lost_s": 1.0}, set()),
        ({"after": "kill", "readable": True, "lost_s": 1.01}, {"recorder: lost by a kill"}),
        (
            {"after": "stop", "readable": False, "why_not": "no MCAP"},
            {"recorder: recordings that cannot be read"},
        ),
        ({"after": "disk full", "readable": True, "lived": True, "said": 1}, set()),
        (
            {"after": "disk full", "readable": True, "lived": False, "said": 1},
            {"recorder: full disks that ended it or were not logged once"},
        ),
        (
            {"after": "disk full", "readable": True, "lived": True, "said": 2},
            {"recorder: full disks that ended it or were not logged once"},
        ),
    ],
)
def test_recordings(make: Make, what: dict[str, Any], wrong: set[str]) -> None:
    assert failing(make(events=(*STORY, happened(150.0, "recording", what)))) == wrong


@pytest.mark.parametrize(
    ("what", "wrong"),
    [
        ({"how": "it ran its time", "error": False, "status": {"master": 0, "recorder": None}}, set()),
        ({"how": "the robot never followed", "error": True, "status": {}}, {"soak: ended by an error"}),
        (
            {"how": "interrupted", "error": False, "status": {"slave": 70}},
            {"soak: processes with a bad exit status"},
        ),
    ],
)
def test_how_it_ended(make: Make, what: dict[str, Any], wrong: set[str]) -> None:
    assert failing(make(events=(*STORY, happened(599.0, "end", what)))) == wrong


def test_without_faults_and_commands_nothing_is_claimed(make: Make) -> None:
    seen = make(events=STORY[:6], sent=0.0)
    verdicts = judged(seen)
    assert verdicts["commands: lost, unexplained"].outcome is Outcome.NOT_JUDGED
    assert verdicts["guard: slowest hold after a fault"].outcome is Outcome.NOT_JUDGED
    failed_ = [v.name for v in verdicts.values() if v.outcome is Outcome.FAILED]
    assert failed_ == ["sides without a single command"]


def test_a_soak_that_was_killed_in_its_start_is_judged_too(make: Make) -> None:
    assert judged(make(events=STORY[:1], seconds=2))


@pytest.mark.parametrize("column", ["sent", "arrived"])
def test_a_soak_that_saw_no_command_at_all_fails(make: Make, column: str) -> None:
    assert "commands: sides without a single command" in failing(make(**{column: 0.0}))


def test_both_sides_still_for_5_s_fail_though_no_number_is_missing(make: Make) -> None:
    seen = make(sent=lambda at_s: np.where((at_s > 300) & (at_s <= 305), 0.0, 12.5), gone=at(306.0, 62.0))
    verdict = judged(seen)["commands: due but never arrived, unexplained"]
    assert (verdict.outcome, verdict.measured) == (Outcome.FAILED, 62.0)
    assert judged(seen)["commands: lost, unexplained"].outcome is not Outcome.FAILED


def test_that_the_robot_left_off_explains_no_command_that_was_due(make: Make) -> None:
    left = happened(305.5, "left", {"guard": "hold", "reason": "no command"})
    seen = make(events=(*STORY, left), gone=at(306.0, 62.0))
    assert judged(seen)["commands: due but never arrived, unexplained"].outcome is Outcome.FAILED
    assert judged(make(events=(*STORY, left), lost=at(306.0)))["commands: lost, unexplained"].measured == 0.0
    in_a_fault = make(gone=at(104.0, 62.0))
    assert judged(in_a_fault)["commands: due but never arrived, unexplained"].outcome is Outcome.PASSED


def test_what_was_due_is_not_judged_where_the_robot_does_not_tell(make: Make) -> None:
    verdict = judged(make(due=np.nan, gone=np.nan))["commands: due but never arrived, unexplained"]
    assert (verdict.outcome, verdict.measured) == (Outcome.NOT_JUDGED, None)


@pytest.mark.parametrize(
    ("column", "name"),
    [
        ("lost", "commands: lost, unexplained"),
        ("refused", "commands: refused by the guard, unexplained"),
        ("times_lost", "loops: times the master lost the robot, unexplained"),
        ("master_missed", "loops: ticks the master missed, unexplained"),
    ],
)
def test_what_nobody_told_is_not_judged_and_no_zero(make: Make, column: str, name: str) -> None:
    assert judged(make())[name].outcome is Outcome.PASSED
    verdict = judged(make(**{column: np.nan}))[name]
    assert (verdict.outcome, verdict.measured) == (Outcome.NOT_JUDGED, None)


@pytest.mark.parametrize(
    ("unknown", "outcome"), [(0, Outcome.PASSED), (0.04, Outcome.PASSED), (0.06, Outcome.NOT_JUDGED)]
)
def test_an_age_that_was_known_for_less_than_95_percent_is_no_pass(
    make: Make, unknown: float, outcome: Outcome
) -> None:
    gone = round(600 * unknown)
    seen = make(age_max_ms=lambda at_s: np.where(abs(at_s - 300.5) < 0.5 * gone, np.nan, 20.0))
    verdict = judged(seen)["commands: oldest accepted command"]
    assert (verdict.outcome, verdict.measured) == (outcome, 20.0 if outcome is Outcome.PASSED else None)
    late = make(
        events=(), age_max_ms=lambda at_s: np.where(abs(at_s - 300.5) < 0.5 * gone, np.nan, AGE_MS + 1.0)
    )
    assert judged(late)["commands: oldest accepted command"].outcome is Outcome.FAILED


@pytest.mark.parametrize(("measured_cm", "outcome"), [(12.0, Outcome.PASSED), (12.01, Outcome.FAILED)])
def test_a_hand_that_went_farther_than_foretold_fails(
    make: Make, measured_cm: float, outcome: Outcome
) -> None:
    tree = {"hand": "left_hand", "foretold_cm": 12.0, "measured_cm": measured_cm}
    verdict = judged(make(events=(*STORY, happened(150.0, "blind", tree))))[
        "guard: hands beyond what was foretold"
    ]
    assert verdict.outcome is outcome
    assert "measured over foretold 1.00" in (verdict.why or "")
