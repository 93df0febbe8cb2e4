"""The row of the lost effort sensor fails where an unknown effort passes for none."""

import numpy as np
import pytest

from common.quaternion import Array
from common.wire import fields
from deploy.harness.faults.effort import EFFORT
from deploy.harness.faults.virtual import try_on_virtual_clock

pack = fields.pack_torques


def as_zero(torque_nm: Array | None) -> bytes | None:
    return pack(None if torque_nm is None else np.nan_to_num(torque_nm))


def test_a_lost_effort_must_not_become_zero(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fields, "pack_torques", as_zero)
    assert "not just the silent drive's effort" in try_on_virtual_clock(EFFORT[0]).wrong[0]
