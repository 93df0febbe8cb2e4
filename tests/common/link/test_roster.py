"""Who is there, from tokens and summaries: only both together, lately, describe a robot."""

from __future__ import annotations

import pytest

from common.link import roster as module
from common.link.roster import Roster
from common.wire.presence import (
    OperatorPresence,
    ProcessPresence,
    present,
    read_operator_presence,
    read_presence,
)
from common.wire.summary import HomeCall, RobotSummary, encode_summary

S = 1_000_000_000


def shown(robot: str = "a", instance: int = 1) -> ProcessPresence:
    return ProcessPresence(robot, "slave", instance, 4, "1.0", f"room {instance}", "nursing")


def told(roster: Roster, at_ns: int, robot: str = "a", instance: int = 1, **changed: object) -> None:
    fields: dict[str, object] = {"sequence": at_ns, "guard": "hold", "reason": "", **changed}
    summary = RobotSummary(robot, instance, **fields)  # type: ignore[arg-type]
    roster.on_summary(f"tandem-summary/{robot}", encode_summary(summary), at_ns)


def test_a_robot_is_listed_with_its_token_and_described_with_its_summary() -> None:
    roster = Roster()
    roster.on_presence(shown(), True, S)
    (listed,) = roster.robots()
    assert listed.fresh(S) is None
    told(roster, 2 * S)
    summary = listed.fresh(2 * S)
    assert summary is not None
    assert summary.guard == "hold"
    roster.on_presence(shown(), False, 3 * S)
    assert "a" not in roster
    assert len(roster) == 0


def test_a_summary_without_a_token_describes_nobody() -> None:
    roster = Roster()
    told(roster, S)
    assert roster.robots() == []
    roster.on_presence(shown(instance=2), True, S)
    told(roster, 2 * S, instance=1)
    assert roster.robots()[0].summary is None, "of another process than the one that lives"


@pytest.mark.parametrize(("age_ns", "fresh"), [(0, True), (3 * S, True), (3 * S + 1, False), (-1, False)])
def test_a_summary_counts_for_three_seconds_from_its_arrival(age_ns: int, fresh: bool) -> None:
    roster = Roster()
    roster.on_presence(shown(), True, S)
    told(roster, 10 * S)
    assert (roster.robots()[0].fresh(10 * S + age_ns) is not None) is fresh


def test_two_of_one_name_are_listed_and_neither_is_described() -> None:
    roster = Roster()
    roster.on_presence(shown(instance=1), True, S)
    told(roster, S)
    roster.on_presence(shown(instance=2), True, S)
    (listed,) = roster.robots()
    assert listed.fresh(S) is None
    roster.on_presence(shown(instance=2), False, S)
    assert listed.fresh(S) is not None


def test_an_older_summary_and_one_on_a_wrong_key_change_nothing() -> None:
    roster = Roster()
    roster.on_presence(shown(), True, S)
    told(roster, S, sequence=5, guard="track")
    told(roster, 2 * S, sequence=5, guard="hold")
    told(roster, 2 * S, sequence=4, guard="hold")
    assert roster.late == 2
    roster.on_summary("tandem-summary/b", encode_summary(RobotSummary("a", 1, 9, "hold", "")), 2 * S)
    roster.on_summary("tandem-summary/a", b"garbage", 2 * S)
    assert roster.undecodable == 1
    summary = roster.robots()[0].fresh(2 * S)
    assert summary is not None
    assert summary.guard == "track"


def test_only_robots_of_the_patterns_are_taken_up() -> None:
    roster = Roster("ward-*", "x")
    for name in ("ward-1", "x", "other"):
        roster.on_presence(shown(name), True, S)
    roster.on_presence(ProcessPresence("ward-2", "master", 1), True, S)
    roster.on_presence(ProcessPresence("ward-3", "slave", 0), True, S)
    assert [one.robot for one in roster.robots()] == ["ward-1", "x"]


def test_more_robots_than_there_can_be_are_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "MOST_ROBOTS", 2)
    roster = Roster()
    for number in range(4):
        roster.on_presence(shown(f"r{number}"), True, S)
    assert (len(roster), roster.beyond) == (2, 2)


def test_how_long_a_home_has_waited_goes_on_between_two_summaries() -> None:
    roster = Roster()
    roster.on_presence(shown(), True, S)
    told(roster, S, call=HomeCall(40.0, "help"))
    listed = roster.robots()[0]
    assert listed.waits_s(2 * S) == pytest.approx(41.0)
    assert listed.waits_s(5 * S) is None, "stale: nobody knows"


def test_operators_come_and_go_by_master() -> None:
    roster = Roster()
    one, other = OperatorPresence("anna", 1), OperatorPresence("anna", 2)
    roster.on_operator(one, True)
    roster.on_operator(other, True)
    roster.on_operator(one, False)
    assert list(roster.operators) == ["anna"]
    roster.on_operator(other, False)
    assert list(roster.operators) == []
    roster.on_operator(other, False)


def test_the_tokens_keys_are_read_back() -> None:
    slave = present("r", "slave", 5, ["tcp/10.0.0.2:7447"], "my/profile")
    assert read_presence(slave.key) == slave
    nurse = OperatorPresence("anna/ä*", 5, "1.2", "host, tcp/1")
    assert read_operator_presence(nurse.key) == nurse
    assert read_operator_presence(slave.key) is None
    assert read_presence(nurse.key) is None
    assert read_operator_presence("tandem/-/operator/a/alive/x/4-1/p") is None
    assert read_operator_presence("tandem/-/operator/a/alive") is None
