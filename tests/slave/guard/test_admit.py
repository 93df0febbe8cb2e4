"""Each gate just inside and just outside, with the gate and without it."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

from common.clock import to_ns
from common.wire.messages import Action, Command
from slave.guard import GATES, State

MakeRig = Callable[..., Any]
Change = Callable[[Any], dict[str, Any]]


def with_value(rig: Any, value: float) -> Any:
    position = rig.target.copy()
    position[7] = value
    return position


def newest(rig: Any) -> int:
    return int(rig.guard._commands._newest_sequence)


def oldest_ns(rig: Any) -> int:
    return int(rig.now_ns - to_ns(rig.config.max_age_s) + rig.offset.bound_ns)


def newest_ns(rig: Any) -> int:
    return int(rig.now_ns + to_ns(rig.config.future_tolerance_s) + rig.offset.bound_ns)


def with_revoked(rig: Any, operator: str) -> dict[str, Any]:
    """The list alone: that the lease ends too is another protection."""
    rig.guard._commands.revoked = frozenset({operator})
    return {}


@dataclass(frozen=True)
class Case:
    gate: str
    inside: Change
    outside: Change


CASES = [
    Case("robot", lambda r: {"robot": "robot-1"}, lambda r: {"robot": "robot-2"}),
    Case("lease", lambda r: {"lease": r.lease}, lambda r: {"lease": r.lease + 1}),
    Case("lease", lambda r: {"lease": r.lease}, lambda r: {"lease": 0}),
    Case("revoked", lambda r: with_revoked(r, "ben"), lambda r: with_revoked(r, "anna")),
    Case("operator", lambda r: {"operator": "anna"}, lambda r: {"operator": "ben"}),
    Case("operator", lambda r: {}, lambda r: {"operator": ""}),
    Case("operator", lambda r: {}, lambda r: {"operator": "Anna"}),
    Case("valid", lambda r: {}, lambda r: {"position_rad": with_value(r, np.nan)}),
    Case("valid", lambda r: {}, lambda r: {"velocity_rad_s": with_value(r, -np.inf)}),
    Case("valid", lambda r: {}, lambda r: {"position_rad": r.target[:-1]}),
    Case("valid", lambda r: {}, lambda r: {"velocity_rad_s": np.zeros((1, r.joints))}),
    Case("valid", lambda r: {}, lambda r: {"valid": np.ones(r.joints - 1, np.bool_)}),
    Case("valid", lambda r: {}, lambda r: {"valid": np.ones(r.joints)}),
    Case("sequence", lambda r: {"sequence": newest(r) + 1}, lambda r: {"sequence": newest(r)}),
    Case("sequence", lambda r: {"sequence": newest(r) + 1000}, lambda r: {"sequence": 0}),
    Case("age", lambda r: {"sampled_ns": oldest_ns(r)}, lambda r: {"sampled_ns": oldest_ns(r) - 1}),
    Case("age", lambda r: {}, lambda r: {"sampled_ns": r.now_ns - 3_600_000_000_000}),
    Case("future", lambda r: {"sampled_ns": newest_ns(r)}, lambda r: {"sampled_ns": newest_ns(r) + 1}),
    Case("future", lambda r: {}, lambda r: {"sampled_ns": r.now_ns + 3_600_000_000_000}),
    Case("deadman", lambda r: {"deadman_held": True}, lambda r: {"deadman_held": False}),
]


def ids(case: Case) -> str:
    return case.gate


@pytest.mark.parametrize("case", CASES, ids=ids)
def test_just_inside_is_accepted(rig: Any, case: Case) -> None:
    rig.to_track()
    assert rig.send(**case.inside(rig)).accepted
    assert rig.guard.state is State.TRACK


@pytest.mark.parametrize("case", CASES, ids=ids)
def test_just_outside_is_refused_by_that_gate_and_counted(rig: Any, case: Case) -> None:
    rig.to_track()
    accepted = len(rig.tracker.accepted)
    rig.sequence += 1
    verdict = rig.give(rig.command(**case.outside(rig)))
    assert not verdict.accepted
    assert verdict.gate == case.gate
    assert verdict.reason
    assert rig.guard.counters.dropped == {case.gate: 1}
    assert len(rig.tracker.accepted) == accepted


@pytest.mark.parametrize("case", CASES, ids=ids)
def test_without_its_gate_it_would_be_accepted(make_rig: MakeRig, case: Case) -> None:
    rig = make_rig(gates=[gate for gate in GATES if gate.name != case.gate]).to_track()
    rig.sequence += 1
    assert rig.give(rig.command(**case.outside(rig))).accepted


def test_an_untrusted_clock_is_refused(rig: Any) -> None:
    rig.to_track()
    rig.offset = replace(rig.offset, trusted=False)
    assert rig.send().gate == "clock"


def test_without_its_gate_an_untrusted_clock_would_be_accepted(make_rig: MakeRig) -> None:
    rig = make_rig(gates=[gate for gate in GATES if gate.name != "clock"]).to_track()
    rig.offset = replace(rig.offset, trusted=False)
    assert rig.send().accepted


def test_every_gate_has_a_case() -> None:
    assert {case.gate for case in CASES} | {"clock"} == {gate.name for gate in GATES}


def test_a_lapsed_token_is_refused_though_nobody_else_has_claimed(rig: Any) -> None:
    rig.to_leased()
    rig.run(1.1, commands=False)
    assert rig.send().gate == "lease"


def test_a_wide_bound_ages_a_command(rig: Any) -> None:
    rig.to_track()
    rig.offset = replace(rig.offset, bound_ns=to_ns(rig.config.max_age_s))
    assert rig.send().gate == "age"


def test_waiting_in_a_mailbox_ages_a_command(rig: Any) -> None:
    rig.to_track()
    waiting = rig.command(sequence=rig.sequence + 1)
    received_ns = rig.now_ns
    rig.run(0.3)
    assert rig.give(replace(waiting, sequence=rig.sequence + 1), received_ns).gate == "age"


def test_commands_slightly_in_the_future_are_accepted(rig: Any) -> None:
    """The offset is known to ± its bound: half of all fresh commands on a fast link seem early."""
    rig.to_track()
    for _ in range(20):
        rig.run(0.08, commands=False)
        assert rig.send(sampled_ns=rig.now_ns + rig.offset.bound_ns).accepted
    assert rig.guard.state is State.TRACK


def test_gates_are_asked_in_order(rig: Any) -> None:
    """Wrong in every way: each gate taken away in turn uncovers the next."""
    rig.to_track()
    wrong: list[tuple[str, Callable[[Command], Command]]] = [
        ("robot", lambda c: replace(c, robot=rig.guard.robot)),
        ("lease", lambda c: replace(c, lease=rig.lease)),
        ("valid", lambda c: replace(c, position_rad=rig.target)),
        ("sequence", lambda c: replace(c, sequence=10_000)),
    ]
    command = rig.command(
        robot="x", lease=1, position_rad=rig.target * np.nan, sequence=0, deadman_held=False,
        sampled_ns=rig.now_ns - 10**12,
    )  # fmt: skip
    rig.offset = replace(rig.offset, trusted=False)
    for gate, right in wrong:
        assert rig.give(command).gate == gate
        command = right(command)
    assert rig.give(command).gate == "clock"
    rig.offset = replace(rig.offset, trusted=True)
    assert rig.give(command).gate == "age"
    assert rig.guard.state is State.TRACK


@pytest.mark.parametrize(
    "spoilt", [{"lease": 5}, {"robot": "robot-2"}, {"sequence": 0}, {"sampled_ns": 0}], ids=str
)
def test_the_deadman_of_a_command_that_fails_otherwise_stops_nobody(rig: Any, spoilt: dict[str, Any]) -> None:
    rig.to_track()
    rig.sequence += 1
    rig.give(rig.command(deadman_held=False, **spoilt))
    assert rig.guard.state is State.TRACK


def test_a_released_deadman_holds_at_once(rig: Any) -> None:
    rig.to_track()
    rig.send(deadman_held=False)
    assert rig.guard.state is State.HOLD
    assert "deadman" in rig.guard.reason
    assert rig.guard.counters.losses == {"deadman": 1}


def test_with_the_deadman_released_nothing_engages(rig: Any) -> None:
    rig.to_leased()
    assert rig.send().accepted
    rig.send(deadman_held=False)
    reply = rig.ask(Action.ENGAGE)
    assert not reply.done
    assert "deadman is released" in reply.text
    assert rig.send().accepted
    assert rig.ask(Action.ENGAGE).done


def test_a_command_overtaken_by_the_release_of_the_deadman_is_refused(rig: Any) -> None:
    rig.to_leased()
    overtaken = rig.command(sequence=rig.sequence + 1)
    rig.give(rig.command(sequence=rig.sequence + 2, deadman_held=False))
    assert rig.give(overtaken).gate == "sequence"
    assert not rig.ask(Action.ENGAGE).done


@pytest.mark.parametrize("case", [c for c in CASES if c.gate not in ("lease", "robot")], ids=ids)
def test_refused_commands_do_not_renew_the_lease(rig: Any, case: Case) -> None:
    rig.to_leased()
    for _ in range(15):
        rig.run(0.08, commands=False)
        rig.sequence += 1
        rig.give(rig.command(**case.outside(rig)))
    assert rig.guard.operator == ""
    assert rig.ask(Action.CLAIM, "ben").done


@pytest.mark.parametrize("case", [c for c in CASES if c.gate != "deadman"], ids=ids)
def test_refused_commands_do_not_feed_the_watchdog(rig: Any, case: Case) -> None:
    rig.to_track()
    for _ in range(3):
        rig.run(0.08, commands=False)
        rig.sequence += 1
        rig.give(rig.command(**case.outside(rig)))
    assert rig.guard.state is State.HOLD
    assert "refused" in rig.guard.reason


def test_refused_commands_do_not_advance_the_sequence(rig: Any) -> None:
    rig.to_track()
    rig.give(rig.command(sequence=10**6, sampled_ns=0))
    assert rig.send().accepted


@pytest.mark.parametrize("again", [0, 1])
def test_a_replayed_command_is_refused(rig: Any, again: int) -> None:
    rig.to_track()
    rig.sequence += 1
    command = rig.command()
    assert rig.give(command).accepted
    if again:
        rig.run(0.08)
    assert rig.give(command).gate == "sequence"


def test_yesterdays_commands_are_refused_at_start_up(make_rig: MakeRig) -> None:
    """Retained or replayed: with the token of then, good numbers and fresh-looking stamps."""
    yesterday = make_rig().to_track()
    token = yesterday.lease
    rig = make_rig(draw_token=iter(range(50_000, 60_000)).__next__).to_hold()
    for sequence in range(20):
        assert rig.give(rig.command(lease=token, sequence=sequence)).gate == "lease"
    assert rig.claim().done
    for sequence in range(20):
        assert rig.give(rig.command(lease=token, sequence=sequence)).gate == "lease"
    assert not rig.ask(Action.ENGAGE).done
    assert rig.guard.state is State.HOLD


@pytest.mark.parametrize("step_s", [-3600.0, 3600.0])
def test_a_master_whose_clock_is_stepped_is_held(rig: Any, step_s: float) -> None:
    rig.to_track()
    for _ in range(4):
        rig.run(0.08, commands=False)
        assert rig.send(sampled_ns=rig.now_ns + to_ns(step_s)).gate in ("age", "future")
    assert rig.guard.state is State.HOLD
