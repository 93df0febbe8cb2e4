"""The page's copy of the guard's table is the guard's."""

from deploy.console.model import guard_table
from slave.guard.states import ENGAGED, TRANSITIONS, State


def test_the_copy_is_the_table() -> None:
    assert list(guard_table.STATES) == [str(state) for state in State]
    assert set(guard_table.ENGAGED) == {str(state) for state in ENGAGED}
    table = [(str(before), str(event), str(after)) for (before, event), after in TRANSITIONS.items()]
    assert sorted(guard_table.TRANSITIONS) == sorted(table)
