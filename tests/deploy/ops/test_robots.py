"""`tandem robots` says why its list may lack robots, and tells every change but the passing of time."""

from __future__ import annotations

import pytest
from typer.testing import CliRunner

from common.link.config import LinkConfig
from common.link.roster import Roster
from common.wire.presence import OperatorPresence, ProcessPresence
from common.wire.summary import HomeCall, RobotSummary, encode_summary
from common.wire.topics import SUMMARY
from deploy.cli import app
from deploy.client.roster_view import RosterRow, RosterRows, roster_rows
from deploy.ops.robots import _without_times, unreached
from tests.common.link.test_link import free_endpoint


def row(**changed: object) -> RosterRows:
    fields: dict[str, object] = {
        "robot": "a", "place": "", "software": "", "schema": 5, "profile": "", "guard": "hold", "reason": "",
        "operator": "", "offered_to": "", "faults": 0, "waits_s": None, "words": "", "namesakes": 0,
        **changed,
    }  # fmt: skip
    return RosterRows([RosterRow(**fields)], [])  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "changed", [{"guard": "track"}, {"operator": "anna"}, {"offered_to": "ben"}, {"faults": 1},
                {"waits_s": 1.0}, {"words": "help"}, {"namesakes": 1}, {"place": "elsewhere"}],
)  # fmt: skip
def test_each_change_is_worth_a_line(changed: dict[str, object]) -> None:
    assert _without_times(row(**changed)) != _without_times(row())


def test_time_that_passes_is_worth_none() -> None:
    before, after = row(waits_s=0.0, reason="for 0 s"), row(waits_s=2.0, reason="for 2 s")
    assert _without_times(before) == _without_times(after)


def test_words_from_elsewhere_command_no_terminal() -> None:
    roster, evil = Roster(), "\x1b[2J\nb"
    roster.on_presence(ProcessPresence("a", "slave", 7, 5, evil, evil, evil), here=True, now_ns=0)
    told = RobotSummary("a", 7, 1, evil, evil, evil, evil, call=HomeCall(1.0, evil))
    roster.on_summary(SUMMARY.key_for("a"), encode_summary(told), 0)
    roster.on_operator(OperatorPresence(evil, 1), here=True)
    rows = roster_rows(roster, 0)
    assert rows.robots[0].words == " [2J b"
    assert "\\x1b" not in repr(rows)
    assert "\\n" not in repr(rows)


def test_ends_that_do_not_answer_are_named() -> None:
    ends = ["tcp/10.0.0.1:7447", "tcp/10.0.0.2:7447"]
    assert unreached(LinkConfig(connect=ends), 2) == ""
    assert unreached(LinkConfig(connect=ends, mode="client"), 1) == "", "one router leads to every robot"
    assert unreached(LinkConfig(connect=ends), 1).startswith("1 of 2 endpoints do not answer")
    assert unreached(LinkConfig(connect=ends[:1]), 0).startswith("nobody answers at tcp/10.0.0.1:7447")


def test_an_empty_list_of_an_end_where_nobody_is_fails() -> None:
    end = free_endpoint()
    done = CliRunner().invoke(app, ["robots", "--connect", end, "--once"])
    assert done.exit_code != 0
    assert "nobody answers" in str(done.exception) + done.output
