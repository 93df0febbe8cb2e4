"""What `tandem status` says of an operator's shift."""

from __future__ import annotations

from common.metrics.master import ArmLoad, ZeroPoseTaken
from deploy.client.shift import shift_lines
from tests.published import commanded, master_metrics


def test_each_thing_is_one_line() -> None:
    master = master_metrics(
        commanded(scaling={"left_arm": 0.5, "head": 1.0}),
        arm_load={"left_arm": ArmLoad(29.0, 0.0, 0.0), "right_arm": ArmLoad(93.0, 12.0, 70.0)},
        zero_pose_again=ZeroPoseTaken(1, 1, "head leaned by 25°", {}),
    )
    assert shift_lines(master) == (
        "motion scaled about the posture at engage: left_arm × 0.5, head × 1",
        "arms raised in the last 15 min: right_arm 1.6 min",
        "zero pose refused: head leaned by 25°: the old one stays",
    )


def test_nothing_is_said_where_there_is_nothing() -> None:
    assert shift_lines(None) == ()
    assert shift_lines(master_metrics()) == ()
    assert shift_lines(master_metrics(zero_pose_again=ZeroPoseTaken(2, 0, "", {}))) == ()
