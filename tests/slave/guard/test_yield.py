"""After contact the robot yields only by angles that can be believed."""

from __future__ import annotations

import numpy as np
import pytest

from slave.guard.body import Body

from .scenarios import MakeRig

PUSHED = "pushed at left_hand"
SHOULDER = 3
OTHER_FAULTS = {
    "nothing else": Body(contact=PUSHED),
    "a drive": Body(contact=PUSHED, drives={"left_elbow_pitch": "its own angle is 40° off"}),
    "the base": Body(contact=PUSHED, base="leans by 12°"),
    "a namesake": Body(contact=PUSHED, namesake="another robot bears this name"),
}


@pytest.mark.parametrize("fault", OTHER_FAULTS)
def test_it_yields_only_where_nothing_but_contact_is_wrong(make_rig: MakeRig, fault: str) -> None:
    """With a drive that is wrong, what looks like contact may be that, and so may the way back."""
    rig = make_rig().to_track()
    rig.target = rig.measured + np.eye(rig.joints)[SHOULDER] * 0.4
    rig.run(0.5)
    rig.pipeline.contact.finding = PUSHED
    rig.body = OTHER_FAULTS[fault]
    stopped_rad = rig.step().position_rad[SHOULDER]
    course = [setpoint.position_rad[SHOULDER] for setpoint in rig.run(0.5)]
    assert bool(min(course) < stopped_rad - 0.01) is (fault == "nothing else")


def test_silent_encoders_end_it(make_rig: MakeRig) -> None:
    rig = make_rig().to_track()
    rig.target = rig.measured + np.eye(rig.joints)[SHOULDER] * 0.4
    rig.run(0.5)
    rig.pipeline.contact.finding = PUSHED
    rig.body = OTHER_FAULTS["nothing else"]
    rig.run(0.1)
    assert rig.pipeline.motion.reflex.active
    rig.encoder_valid[SHOULDER] = False
    rig.run(0.1)
    assert not rig.pipeline.motion.reflex.active
