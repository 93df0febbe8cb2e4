"""The deadman over real processes: a glove's button on the suit's bus is let go, and the robot stands."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import TYPE_CHECKING

import can
import numpy as np
import pytest

from common.can.config import BusConfig
from common.can.interface import open_bus
from common.clock import monotonic_ns, to_ns, to_s
from common.wire.messages import Command
from deploy.harness.engage import until_tracking
from deploy.harness.host import HostWatch
from deploy.harness.rig import ROBOT, Rig, open_rig
from deploy.harness.start import start_all
from deploy.sim.suit.buttons import DEADMAN, PERIOD_S, Buttons
from master.suit.protocol import SHIPPED_DBC

if TYPE_CHECKING:
    from tests.conftest import OnThisHost

pytestmark = [pytest.mark.live, pytest.mark.timeout(400)]
WITH_BUTTON = 'operator.deadman={source="can",bus="suit",signal="DEADMAN"}'
TOLD_S = 0.1
"""From the button to the robot's state: one frame, one message each way, at most one state later (20 ms)."""
STANDS_S = 0.35
STILL_RAD = 0.0031
"""Two counts of an encoder."""


class Glove:
    """Sends the buttons on the suit's bus as its node does, and at once when one changes."""

    def __init__(self, bus: can.BusABC) -> None:
        self._bus = bus
        self._node = Buttons(SHIPPED_DBC)

    def set(self, *pressed: str) -> int:
        """What is pressed from now on; when that was told."""
        self._node.pressed = set(pressed)
        self.send()
        return monotonic_ns()

    def send(self) -> None:
        frame = self._node.frame()
        self._bus.send(can.Message(arbitration_id=frame.id, data=frame.data, is_extended_id=False))


@asynccontextmanager
async def worn(port: int) -> AsyncIterator[Glove]:
    bus = open_bus(
        BusConfig(
            name="suit", interface="udp_multicast", channel="239.74.163.2",
            options={"port": port, "hop_limit": 0},
        )
    )  # fmt: skip
    glove = Glove(bus)

    async def tells() -> None:
        while True:
            glove.send()
            await asyncio.sleep(PERIOD_S)

    telling = asyncio.create_task(tells())
    try:
        yield glove
    finally:
        telling.cancel()
        bus.shutdown()


async def start(rig: Rig, glove: Glove) -> None:
    """Start all. The button is pressed once the master has seen it released: no earlier press counts."""

    async def one(name: str) -> None:
        await rig.start(name)
        if name == "master":
            await rig.until(lambda: rig.observer.command is not None, 30.0, "command")
            assert rig.observer.command is not None
            # the first command may be older than the first frame of the button: 25 commands are 2 s
            seen = rig.observer.command.sequence + 25
            await rig.until(lambda: newest(rig).sequence >= seen, 30.0, "2 s of commands")
            assert not newest(rig).deadman_held
            glove.set(DEADMAN)

    await start_all(rig, start=one)
    await until_tracking(rig, ROBOT)


def test_a_button_that_is_let_go_holds_the_robot_at_once_and_for_good(on_this_host: OnThisHost) -> None:
    async def story(host: HostWatch) -> None:
        overrides = {"master": [WITH_BUTTON, "estimation.zero_pose_s=1.0"]}
        async with open_rig(overrides=overrides) as rig, worn(rig.can_port) as glove:
            await start(rig, glove)
            observer = rig.observer
            observer.recording = True
            await rig.until(lambda: fast(rig), 30.0, "fast motion")
            before = len(observer.guard_changes)
            released_ns = glove.set()
            await rig.until(lambda: observer.guard == "hold", 5.0, "hold")
            held = observer.guard_changes[before]
            told_s = to_s(held.at_ns - released_ns)
            print(f"\nbutton released → hold in the robot's state: {1e3 * told_s:.0f} ms")  # noqa: T201
            assert "deadman" in held.reason
            glove.set(DEADMAN)  # pressed again: the robot stands all the same
            until_ns = released_ns + to_ns(1.5)
            await rig.until(lambda: observer.sent_ns > until_ns, 5.0, "a second and a half of states")
            assert observer.guard == "hold"
            rows = [s for s in observer.states if s.encoder_ns > released_ns]
            at_s = np.array([to_s(s.encoder_ns - released_ns) for s in rows])
            angles = np.array([s.position_rad for s in rows])
            moving = np.abs(angles - angles[-1]).max(axis=1) > STILL_RAD
            stood_s = float(at_s[moving].max(initial=0.0))
            way_deg = float(np.degrees(np.abs(angles[-1] - angles[0]).max()))
            print(f"→ last motion at the encoders: {1e3 * stood_s:.0f} ms, way {way_deg:.1f}°")  # noqa: T201
            assert way_deg > 0.3, "the robot was not in motion: nothing is shown"
            assert told_s <= TOLD_S
            assert stood_s <= STANDS_S

    on_this_host(story)


def newest(rig: Rig) -> Command:
    """The newest command."""
    assert rig.observer.command is not None
    return rig.observer.command


def fast(rig: Rig) -> bool:
    """Whether some joint of the robot has moved at 0.8 rad/s for the last 0.1 s."""
    rows = rig.observer.states[-6:]
    if len(rows) < 6:
        return False
    moved = np.abs(rows[-1].position_rad - rows[0].position_rad).max()
    return float(moved) > 0.8 * to_s(rows[-1].encoder_ns - rows[0].encoder_ns)
