"""The rows of distance fail without the damper."""

from __future__ import annotations

import pytest

from deploy.harness.faults.distance import DISTANCE
from deploy.harness.faults.virtual import VirtualFault, try_on_virtual_clock
from slave.config import SlaveConfig
from slave.limit.damper import DistanceDamper

TABLE = {fault.name: fault for fault in DISTANCE}


@pytest.mark.parametrize("fault", [f for f in DISTANCE if f.also], ids=lambda fault: fault.name)
def test_a_row_fails_without_the_damper(fault: VirtualFault, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(DistanceDamper, "limit", lambda _, step: step.wish_rad_s)
    assert [words for words in try_on_virtual_clock(fault).wrong if "nearer than the margin" in words]


def test_the_wrong_file_fails_where_mistakes_are_not_looked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    fault = TABLE["zone file wrong"]
    mistakes = SlaveConfig.mistakes
    monkeypatch.setattr(
        SlaveConfig, "mistakes", lambda self: [m for m in mistakes(self) if "zones" not in m.key]
    )
    assert try_on_virtual_clock(fault).wrong
