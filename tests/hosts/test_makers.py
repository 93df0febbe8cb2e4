"""A robot whose drives five makers built, as processes: it comes up, is confirmed, follows, and holds."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import pytest

from common.skeleton import load_skeleton
from common.wire.messages import RobotState
from deploy.experiments.demo.options import DemoOptions
from deploy.harness.engage import until_tracking
from deploy.harness.host import HostWatch
from deploy.harness.rig import open_rig
from deploy.harness.start import start_all
from deploy.sim.suit.motion import load_motion

if TYPE_CHECKING:
    from tests.conftest import OnThisHost


PAUSE_S = 8.0
"""The operator's motion stands still for 5 s between two rounds."""


def least_turned_rad(states: Sequence[RobotState]) -> float:
    """Of each maker's drives the joint that turned most; the least of these."""
    turned = np.ptp(np.array([state.position_rad for state in states]), axis=0)
    return float(min(turned[kind::5].max() for kind in range(5)))


def test_a_joint_of_each_kind_turns_in_whatever_part_of_the_motion_it_is_looked_at() -> None:
    """5 s were looked at, of which one in nine shows no motion."""
    skeleton = load_skeleton("nursing")
    motion = load_motion("bottle", skeleton)
    begins_s = np.arange(0.0, motion.period_s, 0.25)

    def least(seconds: float) -> float:
        spans = (motion.state(np.arange(begin, begin + seconds, 0.05))[0] for begin in begins_s)
        return min(float(min(np.ptp(s, axis=0)[kind::5].max() for kind in range(5))) for s in spans)

    assert least(5.0) < 0.1 < least(5.0 + PAUSE_S)


@pytest.mark.live
@pytest.mark.timeout(400)
def test_five_makers_drives_follow_one_operator_and_hold_without_a_master(on_this_host: OnThisHost) -> None:
    options = DemoOptions(servos="makers", camera=False)

    async def story(_: HostWatch) -> None:
        async with open_rig(overrides=options.overrides(), options=options.command_options()) as rig:
            await start_all(rig, home_key=options.home_key)
            await until_tracking(rig)
            rig.observer.recording = True
            await asyncio.sleep(5.0)
            # where in his motion the operator is by then depends on how soon all had started
            turned = "a joint of each kind that turned"
            await rig.until(lambda: least_turned_rad(rig.observer.states) > 0.1, PAUSE_S, turned)
            assert rig.observer.guard == "track"
            states = rig.observer.states
            off = np.abs(np.array([state.position_rad - state.setpoint_rad for state in states]))
            assert np.percentile(off, 99) < 0.15
            assert all(state.encoder_valid.all() for state in states)
            await rig.children["master"].kill()
            await rig.until(lambda: rig.observer.guard == "hold", 5.0, "hold")
            statuses = await rig.stop()
            assert statuses["slave"] == statuses["drives"] == 0
            assert "Traceback" not in rig.children["slave"].log_text()

    on_this_host(story)
