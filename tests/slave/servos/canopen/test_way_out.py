"""Every state of a drive has a way out by the operator's reset, whatever the maker left out of CiA 402."""

from __future__ import annotations

import numpy as np
import pytest

from common.clock import NS_PER_MS
from deploy.sim.drives.faults import DriveFault
from deploy.sim.drives.machine import after, statusword
from slave.servos.canopen.cia402 import DISABLE_VOLTAGE, ENABLE, FAULT_RESET, Power, power, towards_enabled
from tests.slave.servos.canopen.conftest import Wired

ELBOW = "left_elbow_pitch"
COMMANDED = [state for state in Power if state not in (Power.NOT_READY, Power.FAULT_REACTION)]
"""The other two end by themselves, whatever is told."""


@pytest.mark.parametrize("state", COMMANDED)
@pytest.mark.parametrize("drive_knows_16", [True, False])
def test_each_state_leads_to_enabled(state: Power, drive_knows_16: bool) -> None:
    seen, last = [state], ENABLE
    for step in range(12):
        word = towards_enabled(power(statusword(seen[-1])), last, True, knows_16=step < 5)
        seen.append(after(seen[-1], word, last, drive_knows_16))
        last = word
    assert seen[-1] is Power.ENABLED


def test_voltage_is_disabled_only_in_quick_stop_without_transition_16() -> None:
    for state in Power:
        assert towards_enabled(state, ENABLE, True) != DISABLE_VOLTAGE
        expected = state is Power.QUICK_STOP
        assert (towards_enabled(state, ENABLE, True, knows_16=False) == DISABLE_VOLTAGE) is expected


def test_a_fault_is_reset_by_rising_edges() -> None:
    words, last = [], ENABLE
    for _ in range(6):
        last = towards_enabled(Power.FAULT, last, True)
        words.append(last)
    assert [word == FAULT_RESET for word in words] == [True, False, True, False, True, False]


def test_a_drive_without_transition_16_returns_by_reset_and_restart(wired: Wired) -> None:
    for drive in wired.peer.drives:
        drive.traits.knows_16 = False
    wired.up()
    for again in ("release", "start"):
        wired.drives.stop()
        wired.run(0.5)
        assert all(drive.state is Power.QUICK_STOP for drive in wired.peer.drives)
        getattr(wired.drives, again)(wired.now_ns)
        wired._flush()
        wired.until(lambda: wired.drives.running, 2.0)
        assert dict(wired.drives.faults) == {}
        assert all(drive.state is Power.ENABLED for drive in wired.peer.drives)


def test_a_drive_that_knows_transition_16_is_never_let_go(wired: Wired) -> None:
    wired.up()
    wired.drives.stop()
    wired.run(0.3)
    wired.drives.release(wired.now_ns)
    states = set()
    for _ in range(50):
        wired.run(0.02)
        states |= {drive.state for drive in wired.peer.drives}
    assert states <= {Power.QUICK_STOP, Power.ENABLED}
    assert wired.drives.running


@pytest.mark.parametrize("state", list(Power))
def test_a_reset_brings_a_drive_back_from_any_state(wired: Wired, state: Power) -> None:
    wired.up()
    drive = wired.peer.drives[wired.index(ELBOW)]
    wired.drives.stop()
    wired.run(0.1)
    drive.state = state
    wired.run(0.1)
    if state is Power.NOT_READY:
        drive.state = Power.SWITCH_ON_DISABLED  # its self-test is over
    wired.drives.release(wired.now_ns)
    wired._flush()
    wired.until(lambda: wired.drives.running, 2.0)
    assert dict(wired.drives.faults) == {}


def test_a_fault_reaction_that_lasts_is_waited_for(wired: Wired) -> None:
    wired.up()
    wired.happen(ELBOW, DriveFault.OVER_CURRENT)
    drive = wired.peer.drives[wired.index(ELBOW)]
    drive.state = Power.FAULT_REACTION
    wired.drives.release(wired.now_ns)
    wired._flush()
    wired.until(lambda: wired.drives.running, 2.0)


def test_while_it_brakes_nothing_lets_a_drive_go(wired: Wired) -> None:
    """A drive without transition 16 that is released in full motion brakes first."""
    for drive in wired.peer.drives:
        drive.traits.knows_16 = False
    wired.up()
    wired.setpoint = wired.read_rad()
    for _ in range(20):
        wired.setpoint = np.clip(wired.setpoint + 0.02, wired.skeleton.lower_rad, wired.skeleton.upper_rad)
        wired.run(0.02)
    wired.drives.stop()
    wired.run(0.04)
    wired.drives.release(wired.now_ns)
    wired._flush()
    stopped_ns = wired.now_ns
    while wired.now_ns - stopped_ns < 450 * NS_PER_MS:
        wired.run(0.02)
        assert all(drive.state is Power.QUICK_STOP for drive in wired.peer.drives)
    assert np.abs(wired.speed_rad_s(0.1)).max() < 0.02
    wired.until(lambda: wired.drives.running, 1.0)
