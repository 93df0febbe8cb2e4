"""A robot at home, behind its box's and its carrier's translation, and a nurse: docs/behind-nat.md."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

from common.clock import monotonic_ns
from deploy.harness.engage import until_tracking
from deploy.harness.host import HostWatch
from deploy.harness.start import start_all
from tests.net.far import DOOR, Flow, far_apart
from tests.net.homes import MOVED, TRANSLATED, open_homes, why_no_homes

if TYPE_CHECKING:
    from tests.conftest import OnThisHost

pytestmark = [
    pytest.mark.live,
    pytest.mark.timeout(400),
    pytest.mark.skipif(bool(why_no_homes()), reason=str(why_no_homes())),
]
FORGOTTEN_S = 3
"""When both boxes forget an idle mapping; a real carrier's does after minutes or hours."""
OUTAGE_S = 9.0
BACK_S = 8.0
"""Mostly 0.1 to 1.2 s, as long as an attempt to connect lasts; once 5.9 s on a host with ten jobs."""


@pytest.mark.parametrize("transport", ["tls", "quic"])
def test_a_robot_at_home_follows_and_comes_back_after_its_line_was_forgotten(
    on_this_host: OnThisHost, transport: str, tmp_path: Path
) -> None:
    async def story(_: HostWatch) -> None:
        with open_homes() as homes:
            homes.forget_after(FORGOTTEN_S)
            async with far_apart(homes, tmp_path, {}, transport=transport) as (rig, _routers):
                await start_all(rig)
                # keep-alives hold the mapping while nobody commands
                await asyncio.sleep(2.0 * FORGOTTEN_S)
                assert homes.mappings(DOOR) == 1
                await until_tracking(rig)
                flow = Flow(rig)
                await asyncio.sleep(1.0)
                assert flow.states[-1][1].guard == "track"
                homes.cut()
                await asyncio.sleep(OUTAGE_S)
                assert homes.mappings(DOOR) == 0, "both boxes have forgotten the line"
                homes.move()
                restored_ns, before = monotonic_ns(), len(flow.states)
                homes.restore()
                await rig.until(lambda: len(flow.states) > before + 10, BACK_S, "state of the robot")
                first_ns, first = flow.states[before]
                print(f"{transport}: back {(first_ns - restored_ns) / 1e9:.2f} s after the line")  # noqa: T201
                assert first.guard == "hold"
                assert "no command" in first.reason
                await rig.until(lambda: flow.news_ns[-1] > restored_ns, BACK_S, "command at the robot")
                await asyncio.sleep(1.0)
                since = [state for _, state in flow.states[before:]]
                assert {state.guard for state in since} == {"hold"}, "nothing moves before somebody engages"
                assert np.ptp([state.setpoint_rad for state in since], axis=0).max() == 0.0
                assert np.ptp([state.position_rad for state in since], axis=0).max() < 0.01
                await until_tracking(rig)
                assert rig.children["slave"].lifetime == rig.children["master"].lifetime == 1

    assert TRANSLATED != MOVED
    on_this_host(story)
