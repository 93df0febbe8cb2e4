"""Every outage that a soak hears is held against what the robot had foretold."""

from __future__ import annotations

import pytest

from common.wire.codec import encode
from deploy.experiments.soak.files.happenings import BlindWayMeasured, Happening
from deploy.experiments.soak.watch import Watch
from tests.deploy.measure.test_blind import SKELETON, outage


def heard(foretold_m: float) -> list[BlindWayMeasured]:
    found: list[Happening] = []
    watch = Watch(SKELETON, found.append)
    for state in outage(foretold_m):
        watch.on_state(encode(state), state.sent_ns)
    return [one for one in found if isinstance(one, BlindWayMeasured)]


def test_an_outage_is_measured_once_for_each_hand() -> None:
    assert [one.hand for one in heard(0.2)] == ["left_hand", "right_hand"]


@pytest.mark.parametrize(("share", "exceeds"), [(1.001, False), (0.999, True)])
def test_a_way_that_is_foretold_too_short_is_seen(share: float, exceeds: bool) -> None:
    gone_m = heard(0.2)[0].measured_cm / 100.0
    left = heard(share * gone_m)[0]
    assert (left.measured_cm > left.foretold_cm) is exceeds
