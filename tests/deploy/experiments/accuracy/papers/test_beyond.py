from __future__ import annotations

import pytest

from deploy.experiments.accuracy.papers import beyond
from deploy.experiments.accuracy.papers.figures import gather


@pytest.mark.long
def test_the_joints_constraints_keep_the_elbows_where_the_field_turns() -> None:
    rows = {row.name: row for row in gather({1: beyond.experiment(1, 9.0, ["nursing"])})}
    held = rows["elbow, constraints online: disturbed / undisturbed"]
    assert held.target == 1.2
    assert held.outcome == "passed", held.values
    alone = rows["elbow, constraints off: disturbed / undisturbed"].worst
    assert alone is not None
    assert alone > 2.0, "or the disturbance would disturb nobody"
