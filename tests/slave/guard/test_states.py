from pathlib import Path

import pytest

import slave.guard
from slave.guard import GATES, State
from slave.guard.states import ENGAGED, MOVING, TRANSITIONS, GuardEvent, mermaid, next_state

README = (Path(slave.guard.__file__).parent / "README.md").read_text("utf-8")


def test_only_engage_from_hold_begins_to_move_and_the_clutch_of_a_robot_that_is_engaged() -> None:
    assert {pair for pair, after in TRANSITIONS.items() if after is State.ALIGN} == {
        (State.HOLD, GuardEvent.ENGAGE),
        (State.CLUTCH, GuardEvent.CLUTCH_IN),
    }


def test_only_a_robot_that_moves_can_wait_for_the_clutch() -> None:
    before = {state for (state, _), after in TRANSITIONS.items() if after is State.CLUTCH}
    assert before == MOVING


def test_only_alignment_leads_to_track() -> None:
    assert {pair for pair, after in TRANSITIONS.items() if after is State.TRACK} == {
        (State.ALIGN, GuardEvent.ALIGNED)
    }


@pytest.mark.parametrize("state", State)
def test_estop_wins_in_every_state(state: State) -> None:
    assert next_state(state, GuardEvent.ESTOP) is State.ESTOP


@pytest.mark.parametrize("event", sorted(set(GuardEvent) - {GuardEvent.RESET}))
def test_nothing_but_reset_leaves_estop(event: GuardEvent) -> None:
    assert next_state(State.ESTOP, event) is State.ESTOP


def test_reset_leads_to_hold_and_only_from_estop() -> None:
    assert next_state(State.ESTOP, GuardEvent.RESET) is State.HOLD
    for state in set(State) - {State.ESTOP}:
        assert next_state(state, GuardEvent.RESET) is state


@pytest.mark.parametrize("state", sorted(ENGAGED))
@pytest.mark.parametrize("event", [GuardEvent.LOSS, GuardEvent.DISENGAGE])
def test_every_loss_while_engaged_holds(state: State, event: GuardEvent) -> None:
    assert next_state(state, event) is State.HOLD


def test_a_pair_that_is_not_listed_changes_nothing() -> None:
    for state in State:
        for event in GuardEvent:
            if (state, event) not in TRANSITIONS:
                assert next_state(state, event) is state


def test_diagram_names_every_transition() -> None:
    lines = mermaid().splitlines()
    assert lines[:2] == ["stateDiagram-v2", "    [*] --> boot"]
    assert len(lines) == 2 + len(TRANSITIONS)


def test_docs_show_the_table_that_is_in_force() -> None:
    assert f"```mermaid\n{mermaid()}\n```" in README


def test_docs_list_the_gates_in_force() -> None:
    table = "\n".join(f"| {i} | {gate.name} | {gate.asks} |" for i, gate in enumerate(GATES, 1))
    assert f"{table}\n\n" in README
