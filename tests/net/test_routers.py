"""Linked routers between a home and a nurse, of which one fails: docs/behind-nat.md, *Several routers*."""

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
from tests.net.far import Flow, doors, far_apart
from tests.net.homes import open_homes, why_no_homes

if TYPE_CHECKING:
    from tests.conftest import OnThisHost

pytestmark = [
    pytest.mark.live,
    pytest.mark.timeout(400),
    pytest.mark.skipif(bool(why_no_homes()), reason=str(why_no_homes())),
]
AGAIN_S = 1.5


@pytest.mark.parametrize("fails", ["the home's router", "the nurse's router"])
@pytest.mark.parametrize("how", ["killed", "switched off"])
def test_commands_flow_again_by_another_router_and_nothing_moves_meanwhile(
    on_this_host: OnThisHost, how: str, fails: str, tmp_path: Path
) -> None:
    """Homes at the first router, nurses at the third, all at the second if theirs is gone."""

    async def story(_: HostWatch) -> None:
        with open_homes(3) as homes:
            first, second, third = doors(homes)
            overrides = {
                "slave": [f"link.connect={[first, second]}"],
                "master": [f"link.connect={[third, second]}"],
            }
            number = 0 if fails == "the home's router" else 2
            async with far_apart(homes, tmp_path, overrides, watched=2 - number) as (rig, routers):
                await start_all(rig)
                await until_tracking(rig)
                flow = Flow(rig)
                await asyncio.sleep(1.0)
                failed_ns = monotonic_ns()
                if how == "killed":
                    await routers[number].kill()
                else:
                    homes.unplug(number)
                await asyncio.sleep(4.0)
                gap_s = flow.gap_s(failed_ns)
                print(f"{fails} {how}: {gap_s:.2f} s without a command, then {rig.observer.guard}")  # noqa: T201
                assert flow.news_ns[-1] > failed_ns + 3_000_000_000, "commands flow"
                assert gap_s <= AGAIN_S
                held = [state for _, state in flow.states if state.guard == "hold"]
                if held:
                    setpoints = np.array([state.setpoint_rad for state in held[5:]])
                    assert np.ptp(setpoints, axis=0).max() == 0.0, "nothing moves before somebody engages"
                    assert rig.observer.guard == "hold"
                    await until_tracking(rig)

    on_this_host(story)
