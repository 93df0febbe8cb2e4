"""Watch and command are two things: what leads from the one to the other, and what never does."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.wire.codec import VERSION
from common.wire.presence import ProcessPresence
from common.wire.summary import HomeCall, RobotSummary, encode_summary
from common.wire.topics import SUMMARY
from master.watched import GONE_S, TakenRobot, WatchedRobots

S = 1_000_000_000
ME = "anna"


class Desk:
    """A master that watches every robot; `heard` plays what a robot tells."""

    def __init__(self, profile: str = "nursing") -> None:
        self.watched = WatchedRobots(ME, ["*"], profile)
        self.sequence = 0

    def shows(
        self, here: bool = True, instance: int = 1, schema: int = VERSION, profile: str = "nursing"
    ) -> None:
        presence = ProcessPresence("a", "slave", instance, schema, "1.0", "home", profile)
        self.watched.roster.on_presence(presence, here, 0)

    def heard(self, at_ns: int, instance: int = 1, **changed: object) -> None:
        self.sequence += 1
        fields: dict[str, object] = {"guard": "hold", "reason": "", **changed}
        summary = RobotSummary("a", instance, self.sequence, **fields)  # type: ignore[arg-type]
        self.watched.roster.on_summary(SUMMARY.key_for("a"), encode_summary(summary), at_ns)

    def takes(self, now_ns: int) -> bool:
        return self.watched.to_take(now_ns, ()) == ["a"]

    def lets_go(self, now_ns: int, held: bool = False, lost_ns: int = 0) -> bool:
        return "a" in self.watched.to_let_go(now_ns, {"a": TakenRobot(held, lost_ns)})


def test_a_robot_is_taken_when_its_own_word_says_who_wants_it() -> None:
    desk = Desk()
    desk.shows()
    assert not desk.takes(S)
    desk.heard(S)
    assert not desk.takes(S), "free, and nobody asked"
    desk.heard(S, wanted_by="ben")
    assert not desk.takes(S)
    desk.heard(S, wanted_by=ME)
    assert desk.takes(S)
    assert desk.watched.to_take(S, ["a"]) == [], "it is commanded already"


def test_a_robot_offered_by_its_holder_is_taken() -> None:
    desk = Desk()
    desk.shows()
    desk.heard(S, operator="ben", offered_to=ME)
    assert desk.takes(S)


@given(
    guard=st.sampled_from(["boot", "hold", "align", "track", "estop", "clutch"]),
    operator=st.sampled_from(["", "ben", ME]),
    offered_to=st.sampled_from(["", "ben"]),
    wanted_by=st.sampled_from(["", "ben"]),
    let_go_by=st.sampled_from(["", "ben", ME]),
    calls=st.booleans(),
)
def test_nothing_else_takes_a_robot(
    guard: str, operator: str, offered_to: str, wanted_by: str, let_go_by: str, calls: bool
) -> None:
    desk = Desk()
    desk.shows()
    desk.heard(
        S, guard=guard, operator=operator, offered_to=offered_to, wanted_by=wanted_by, let_go_by=let_go_by,
        call=HomeCall(1.0) if calls else None,
    )  # fmt: skip
    assert not desk.takes(S)


def test_a_stale_presence_takes_nothing() -> None:
    desk = Desk()
    desk.heard(S, wanted_by=ME)
    desk.shows()
    assert not desk.takes(S), "the summary came before the token"
    desk.heard(S, wanted_by=ME)
    assert desk.takes(4 * S)
    assert not desk.takes(4 * S + 1), "3 s without a summary: nobody knows"
    assert not desk.watched.may_claim("a", 4 * S + 1, 0)
    desk.shows(here=False)
    assert not desk.takes(S)
    assert not desk.watched.may_claim("a", S, 0)


def test_of_two_with_one_name_neither_is_taken() -> None:
    desk = Desk()
    desk.shows(instance=1)
    desk.shows(instance=2)
    desk.heard(S, instance=1, wanted_by=ME)
    assert not desk.takes(S)
    assert not desk.watched.may_claim("a", S, 0)


@pytest.mark.parametrize(("schema", "profile"), [(VERSION + 1, "nursing"), (VERSION, "hand")])
def test_a_robot_that_does_not_fit_is_not_taken_and_that_is_said_once(schema: int, profile: str) -> None:
    desk = Desk()
    desk.shows(schema=schema, profile=profile)
    desk.heard(S, wanted_by=ME)
    assert not desk.takes(S)
    assert len(desk.watched.said) == 1
    assert not desk.takes(S)
    assert desk.watched.said == []


def test_a_robot_that_was_let_go_is_not_claimed_again_by_itself() -> None:
    desk = Desk()
    desk.shows()
    desk.heard(S)
    assert not desk.watched.may_claim("a", 2 * S, 2 * S), "what came before the loss says nothing of it"
    desk.heard(2 * S, operator=ME)
    assert not desk.watched.may_claim("a", 2 * S, S), "its summary still names the lease that was lost"
    desk.heard(2 * S + 1, let_go_by=ME)
    assert not desk.watched.may_claim("a", 2 * S + 1, 2 * S)
    assert desk.lets_go(2 * S + 1, lost_ns=2 * S)
    desk.heard(3 * S, let_go_by=ME, wanted_by=ME)
    assert desk.watched.may_claim("a", 3 * S, 2 * S), "asked for anew"
    assert not desk.lets_go(3 * S, lost_ns=2 * S)


def test_a_robot_whose_line_was_lost_is_claimed_again() -> None:
    desk = Desk()
    desk.shows()
    desk.heard(3 * S)
    assert desk.watched.may_claim("a", 3 * S, 2 * S)
    assert not desk.lets_go(3 * S, lost_ns=2 * S)


def test_a_robot_that_another_commands_is_let_go() -> None:
    desk = Desk()
    desk.shows()
    desk.heard(3 * S, operator="ben")
    assert desk.lets_go(3 * S, lost_ns=2 * S)
    assert not desk.lets_go(3 * S, held=True), "the robot's own state is believed first"
    assert not desk.watched.may_claim("a", 3 * S, 2 * S)


def test_one_that_was_asked_for_and_never_claimed_is_let_go() -> None:
    desk = Desk()
    desk.shows()
    desk.heard(S, wanted_by=ME)
    assert not desk.lets_go(S)
    desk.heard(12 * S)
    assert desk.lets_go(12 * S)


def test_one_that_has_gone_is_let_go_after_a_minute() -> None:
    desk = Desk()
    assert not desk.lets_go(S, lost_ns=1)
    assert not desk.lets_go(S + round(GONE_S * S), lost_ns=1)
    assert desk.lets_go(S + round(GONE_S * S) + 1, lost_ns=1)
