"""The rows of a shift fail once what they rely on is taken away."""

from __future__ import annotations

import pytest

from deploy.harness.faults.table import VIRTUAL
from deploy.harness.faults.virtual import try_on_virtual_clock
from master.comfort.zero_pose_again import ZeroPoseConduct
from slave.guard.resting import RestingJoints

TABLE = {fault.name: fault for fault in VIRTUAL}


@pytest.mark.parametrize(
    ("name", "owner", "attribute", "by"),
    [
        ("arm rested", RestingJoints, "rest", lambda *_: None),
        ("zero pose taken again while the robot follows", ZeroPoseConduct, "hold", ""),
    ],
)
def test_a_row_of_the_shift_fails_without_its_protection(
    name: str, owner: type, attribute: str, by: object, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(owner, attribute, by)
    assert try_on_virtual_clock(TABLE[name]).wrong
