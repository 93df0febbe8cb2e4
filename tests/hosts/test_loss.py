"""Real processes killed while the robot tracks: it holds in time, and moves again only when engaged."""

from __future__ import annotations

import signal
from typing import TYPE_CHECKING

import numpy as np
import pytest

from common.clock import to_ns
from common.metrics.slave import SlaveMetrics
from common.wire.messages import RobotState
from deploy.harness.engage import until_tracking
from deploy.harness.host import HostWatch
from deploy.harness.rig import open_rig
from deploy.harness.start import start_tracking

if TYPE_CHECKING:
    from tests.conftest import OnThisHost

pytestmark = [pytest.mark.live, pytest.mark.timeout(400)]

COMMAND_TIMEOUT_S = 0.2
STATE_PERIOD_S = 0.02
BRAKE_S = 0.35
"""From the fastest joint speed to standstill, and the servo's own settling."""


def test_killed_master_leaves_the_robot_holding_until_engaged_anew(on_this_host: OnThisHost) -> None:
    async def story(host: HostWatch) -> None:
        async with open_rig() as rig:
            observer = rig.observer
            await start_tracking(rig)
            observer.recording = True
            await rig.children["master"].kill()
            await rig.until(lambda: observer.guard == "hold", 5.0, "hold")
            held = observer.state
            assert held is not None
            # both stamps are the robot's own clock: no other clock decides how long it took
            assert held.echo is not None
            waited_s = (held.sent_ns - held.echo.received_ns) / 1e9
            await host.known(held.sent_ns)
            host_s = host.lost(held.echo.received_ns, held.sent_ns).excused_s
            assert waited_s < COMMAND_TIMEOUT_S + 2 * STATE_PERIOD_S + host_s
            assert "no command" in held.reason

            braked_ns = held.sent_ns + to_ns(BRAKE_S)
            await rig.until(lambda: observer.sent_ns > braked_ns + to_ns(1.0), 5.0, "more states")
            await host.known(braked_ns)
            still_from_ns = braked_ns + to_ns(host.lost(held.sent_ns, braked_ns).excused_s)
            assert spread_rad([s for s in observer.states if s.sent_ns > still_from_ns]) < np.radians(0.3)

            await rig.start("master")
            await rig.until(lambda: observer.ready, 30.0, "readiness of the new master")
            resumed_ns = observer.sent_ns
            await rig.until(lambda: observer.sent_ns > resumed_ns + to_ns(1.0), 5.0, "a second of states")
            after = [s for s in observer.states if s.sent_ns > resumed_ns]
            assert {s.guard for s in after} == {"hold"}
            assert spread_rad(after) < np.radians(0.3)
            await until_tracking(rig)

    on_this_host(story)


def test_a_killed_slave_is_reported_and_resumes_only_when_engaged(on_this_host: OnThisHost) -> None:
    async def story(host: HostWatch) -> None:
        async with open_rig() as rig:
            observer = rig.observer
            await start_tracking(rig)
            await rig.children["slave"].kill()
            await rig.until(
                lambda: "is silent" in rig.children["master"].log_text(), 5.0, "word from the master"
            )

            await rig.start("slave")
            await rig.until(lambda: observer.ready, 30.0, "readiness with the new slave")
            assert observer.guard == "hold"
            assert "is heard" in rig.children["master"].log_text()
            resumed_ns = observer.sent_ns
            observer.recording = True
            await rig.until(lambda: observer.sent_ns > resumed_ns + to_ns(1.0), 5.0, "a second of states")
            assert {s.guard for s in observer.states} == {"hold"}
            await until_tracking(rig)

    on_this_host(story)


@pytest.mark.usefixtures("default_signals")
@pytest.mark.parametrize("stop", [signal.SIGINT, signal.SIGTERM])
def test_each_process_stops_cleanly(on_this_host: OnThisHost, stop: signal.Signals) -> None:
    async def story(host: HostWatch) -> None:
        async with open_rig() as rig:
            await start_tracking(rig)
            statuses = {role: await rig.children[role].stop(stop) for role in ("master", "suit", "slave")}
            assert statuses == {"master": 0, "suit": 0, "slave": 0}, {
                role: child.last_lines() for role, child in rig.children.items()
            }
            counted = rig.children["slave"].metrics(SlaveMetrics)
            assert counted is not None
            assert counted.guard.accepted > 0

    on_this_host(story)


def spread_rad(states: list[RobotState]) -> float:
    """The largest excursion of any joint's encoder, rad."""
    assert len(states) > 10
    return float(np.ptp([s.position_rad for s in states], axis=0).max())
