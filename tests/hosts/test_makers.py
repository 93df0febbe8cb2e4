"""A robot whose drives five makers built, as processes: it comes up, is confirmed, follows, and holds."""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING

import numpy as np
import pytest

from deploy.experiments.demo.options import DemoOptions
from deploy.harness.engage import until_tracking
from deploy.harness.host import HostWatch
from deploy.harness.rig import open_rig
from deploy.harness.start import start_all

if TYPE_CHECKING:
    from tests.conftest import OnThisHost

pytestmark = [pytest.mark.live, pytest.mark.timeout(400)]


def test_five_makers_drives_follow_one_operator_and_hold_without_a_master(on_this_host: OnThisHost) -> None:
    options = DemoOptions(servos="makers", camera=False)

    async def story(_: HostWatch) -> None:
        async with open_rig(overrides=options.overrides(), options=options.command_options()) as rig:
            await start_all(rig, home_key=options.home_key)
            await until_tracking(rig)
            rig.observer.recording = True
            await asyncio.sleep(5.0)
            assert rig.observer.guard == "track"
            states = rig.observer.states
            turned = np.ptp(np.array([state.position_rad for state in states]), axis=0)
            off = np.abs(np.array([state.position_rad - state.setpoint_rad for state in states]))
            by_kind = [turned[kind::5].max() for kind in range(5)]
            assert min(by_kind) > 0.1, f"of each kind one joint at least has turned: {by_kind} rad"
            assert np.percentile(off, 99) < 0.15
            assert all(state.encoder_valid.all() for state in states)
            await rig.children["master"].kill()
            await rig.until(lambda: rig.observer.guard == "hold", 5.0, "hold")
            statuses = await rig.stop()
            assert statuses["slave"] == statuses["drives"] == 0
            assert "Traceback" not in rig.children["slave"].log_text()

    on_this_host(story)
