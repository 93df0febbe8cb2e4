"""What `tandem contact` is judged by: each verdict just within and just beyond its limit."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from deploy.experiments.contact.trials import Meeting, Pair
from deploy.experiments.contact.view import flights_table, judge, pairs_table
from deploy.measure.verdict import Outcome
from deploy.sim.patient.free_run import FreeRun
from deploy.sim.patient.impact import Impact

UNSEEN = Impact(0.5, 100.0, 1.5, 90.0, None, None, 0.0)
SEEN = Impact(0.5, 35.0, 0.1, 0.0, 0.052, 0.002, 0.03)
AIR = FreeRun(60.0, (), 0, 0.5, "neck_yaw")


def pairs(**changes: Any) -> list[Pair]:
    return [
        Pair(Meeting("hand", 0.5, clamped), UNSEEN, replace(SEEN, **changes) if clamped else SEEN)
        for clamped in (False, True)
    ]


def red(pairs: list[Pair], air: FreeRun = AIR) -> list[str]:
    return [v.name for v in judge(pairs, {"bottle": air}) if v.outcome is Outcome.FAILED]


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


def test_a_false_stop_is_red_and_no_motion_is_not_judged() -> None:
    assert red(pairs(), replace(AIR, false_stops=("pushed",))) == ["false stops"]
    assert [v.name for v in judge(pairs(), {}) if v.outcome is Outcome.NOT_JUDGED] == ["false stops"]


def test_tables_have_a_row_each() -> None:
    assert pairs_table(pairs()).row_count == 2
    assert flights_table({"bottle": AIR}).row_count == 1
