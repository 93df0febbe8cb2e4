from __future__ import annotations

import pytest

from deploy.experiments.accuracy.papers import telerobot
from deploy.experiments.accuracy.papers.figures import gather
from deploy.measure.paper import ETA_PERCENT, TABLE_1
from deploy.sim.suit.tray import TrayConfig

SHORT_SESSION = TrayConfig(attitudes=20, still_s=2.5, tumble_s=60.0)


@pytest.mark.long
def test_units_as_delivered_reach_table_1_and_eta_once_calibrated() -> None:
    """One loop of the motion; the command runs two, with a longer session."""
    rows = {row.name: row for row in gather({1: telerobot.own_calibration(1, 16.5, SHORT_SESSION)})}
    for joint, paper in TABLE_1.items():
        row = rows[f"{joint.replace('_', ' ')}, mean error"]
        assert row.paper == row.target == paper.error_deg
        assert len(row.values) == 2, "both arms"
        assert row.outcome == "passed", (joint, row.values)
    eta = rows["η (Eq. 25)"]
    assert (eta.paper, eta.target) == (ETA_PERCENT, 1.0)
    assert eta.outcome == "passed", eta.values


@pytest.mark.long
def test_what_only_a_suit_knows_brings_eta_below_its_target() -> None:
    """Of the arms of this seed one is the worst of ten where each node goes by itself."""
    alone, suit = (
        {row.name: row for row in gather({1: run(1, 16.5)})}["η (Eq. 25)"]
        for run in (telerobot.whole_way, telerobot.as_a_suit)
    )
    assert suit.outcome == "passed", suit.values
    assert suit.worst is not None
    assert alone.worst is not None
    assert suit.worst < 0.8 * alone.worst


def test_a_run_too_short_to_judge_misses_its_targets() -> None:
    rows = gather({1: telerobot.whole_way(1, seconds=1.0)})
    assert all(row.outcome == "failed" for row in rows if row.target is not None)
