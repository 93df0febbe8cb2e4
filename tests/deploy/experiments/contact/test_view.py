"""What `tandem contact` is judged by: each verdict just within and just beyond its limit."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from deploy.experiments.contact.trials import Meeting, Pair
from deploy.experiments.contact.view import judge, pairs_table
from deploy.measure.verdict import Outcome
from deploy.sim.patient.impact import Impact

UNSEEN = Impact(0.5, 100.0, 1.5, 90.0, None, None, 0.0)
SEEN = Impact(0.5, 35.0, 0.1, 0.0, 0.052, 0.002, 0.03)


def pairs(changed: bool = True, **changes: Any) -> list[Pair]:
    """One meeting with a free patient and one with a clamped one; the changes are of the latter, or not."""
    return [
        Pair(Meeting("hand", 0.5, clamped), UNSEEN, replace(SEEN, **changes) if clamped is changed else SEEN)
        for clamped in (False, True)
    ]


def red(pairs: list[Pair]) -> list[str]:
    return [v.name for v in judge(pairs) if v.outcome is Outcome.FAILED]


def test_all_passes_at_the_limits() -> None:
    assert red(pairs()) == []


@pytest.mark.parametrize(
    ("changes", "name"),
    [
        ({"peak_n": 35.1}, "peak force with / without, clamped, 0.5 m/s"),
        ({"noticed_s": 0.0521}, "from threshold to stop, clamped"),
        ({"noticed_s": None}, "from threshold to stop, clamped"),
        ({"pressing_n": 0.1}, "goes on pressing"),
    ],
)
def test_each_turns_red_just_beyond(changes: dict[str, Any], name: str) -> None:
    assert red(pairs(**changes)) == [name]
    assert red(pairs(changed=False, **changes)) == [name.replace("clamped", "free")]


def test_the_table_has_a_row_each() -> None:
    assert pairs_table(pairs()).row_count == 2
