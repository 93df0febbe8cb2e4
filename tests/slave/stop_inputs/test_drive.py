"""Simulated drives tell of their inputs and of safe torque off as makers' drives do."""

from __future__ import annotations

import pytest

from deploy.sim.drives.faults import DriveFault
from slave.servos.canopen.cia402 import Power
from slave.servos.canopen.config import CanopenConfig
from slave.stop_inputs.config import EstopConfig, StopInputConfig
from slave.stop_inputs.drive import DriveStop
from slave.stop_inputs.rule import StopInputs
from tests.slave.servos.canopen.conftest import Wired

ELBOW = "left_elbow_pitch"
BUTTON = StopInputConfig(name="button", source="drive", joint=ELBOW, bit=16)
STO_BIT = StopInputConfig(name="relay", source="drive", joint=ELBOW, bit=31, closed_level="low")
STO = StopInputConfig(name="relay", source="sto", joint=ELBOW)
KINDS = [DriveFault.STO, DriveFault.STO_FAULT, DriveFault.STO_QUIET]


class Stopped(Wired):
    """Drives whose e-stop inputs are judged in every tick, as the slave does."""

    def __init__(self, *inputs: StopInputConfig, tell: bool = True) -> None:
        super().__init__(CanopenConfig(tell_inputs=[ELBOW] if tell else []))
        self._rule = StopInputs(EstopConfig(inputs=list(inputs)))
        self._sources = [DriveStop(one, self.drives.signs) for one in inputs]

    def words(self) -> str:
        levels = [source.read() for source in self._sources]
        return "; ".join(self._rule.step(self.now_ns, levels).values())

    def until_stopped(self, seconds: float) -> float:
        """Seconds until an input stops the robot."""
        began_ns = self.now_ns
        self.until(lambda: bool(self.words()), seconds)
        return (self.now_ns - began_ns) / 1e9

    def until_free(self, seconds: float) -> None:
        self.until(lambda: not self.words(), seconds)

    def stays_free(self, seconds: float) -> bool:
        for _ in range(round(seconds / 0.02)):
            self.run(0.02)
            if self.words():
                return False
        return True


@pytest.mark.parametrize("one", [BUTTON, STO_BIT, STO])
def test_a_robot_that_is_well_is_not_stopped(one: StopInputConfig) -> None:
    wired = Stopped(one)
    wired.up()
    assert wired.stays_free(1.0)
    assert wired.drives.unknown == 0


def test_before_the_drive_has_told_its_input_the_robot_is_stopped() -> None:
    assert "has not sent its inputs" in Stopped(BUTTON).words()
    assert "has not answered yet" in Stopped(STO).words()


@pytest.mark.parametrize(
    ("one", "fault", "said"),
    [
        (BUTTON, DriveFault.INPUT_OPEN, "pressed, or its wire is broken"),
        (STO_BIT, DriveFault.STO, "pressed, or its wire is broken"),
        (STO_BIT, DriveFault.STO_QUIET, "pressed, or its wire is broken"),
        (STO, DriveFault.STO, "its motor stage has no voltage"),
        (STO, DriveFault.STO_FAULT, "says: safe torque off is active (code 8A88, manufacturer)"),
        (STO, DriveFault.STO_QUIET, "has no torque: switch on disabled"),
    ],
)
def test_an_opened_input_stops_within_two_syncs(one: StopInputConfig, fault: DriveFault, said: str) -> None:
    wired = Stopped(one)
    wired.up()
    assert wired.stays_free(0.2)
    wired.happen(ELBOW, fault)
    assert wired.until_stopped(0.2) <= 0.044
    wired.run(0.02)
    assert said in wired.words()


@pytest.mark.parametrize(("fault", "after_s"), [(DriveFault.INPUTS_SILENT, 0.24), (DriveFault.SILENT, 0.24)])
def test_a_drive_that_tells_its_input_no_more_stops(fault: DriveFault, after_s: float) -> None:
    wired = Stopped(BUTTON)
    wired.up()
    assert wired.stays_free(0.2)
    wired.happen(ELBOW, fault)
    assert 0.18 < wired.until_stopped(0.5) <= after_s
    assert "not heard for" in wired.words()


def test_a_drive_that_was_not_asked_to_tell_its_inputs_sends_none() -> None:
    wired = Stopped(BUTTON, tell=False)
    wired.up()
    wired.run(0.2)
    assert wired.words()
    assert wired.drives.unknown == 0


@pytest.mark.parametrize("fault", [DriveFault.OVER_CURRENT, DriveFault.RESTART])
def test_another_fault_is_not_taken_for_safe_torque_off(fault: DriveFault) -> None:
    wired = Stopped(STO)
    wired.up()
    assert wired.stays_free(0.2)
    wired.happen(ELBOW, fault)
    assert wired.stays_free(0.15)


@pytest.mark.parametrize("fault", KINDS)
def test_after_safe_torque_off_a_reset_enables_the_drive_where_it_stands(fault: DriveFault) -> None:
    wired = Stopped(STO)
    wired.up()
    wired.happen(ELBOW, fault)
    wired.until_stopped(0.2)
    wired.drives.stop()
    wired.run(0.5)
    joint = wired.index(ELBOW)
    assert wired.peer.drives[joint].state is not Power.ENABLED
    stood = wired.peer.plant.position_rad[joint]
    wired.happen(ELBOW, DriveFault.NONE)
    wired.run(0.1)
    wired.until_free(0.5)
    wired.drives.release(wired.now_ns)
    wired._flush()
    wired.until(lambda: wired.drives.running, 1.0)
    assert wired.stays_free(0.5)
    assert abs(wired.peer.plant.position_rad[joint] - stood) < 0.01


@pytest.mark.parametrize("fault", KINDS)
def test_a_reset_while_torque_is_still_off_moves_nothing_and_stops_again(fault: DriveFault) -> None:
    """Where a drive tells no level the reset is granted; it then cannot be enabled, and says so once more."""
    wired = Stopped(STO)
    wired.up()
    wired.happen(ELBOW, fault)
    wired.until_stopped(0.2)
    wired.drives.stop()
    wired.run(0.5)
    wired.words()
    wired.run(0.15)
    assert bool(wired.words()) is (fault is DriveFault.STO), "only bit 4 tells a level"
    wired.drives.release(wired.now_ns)
    wired._flush()
    wired.until_stopped(3.0)
    assert ELBOW in wired.drives.faults
    assert wired.peer.drives[wired.index(ELBOW)].state is not Power.ENABLED


@pytest.mark.parametrize("fault", KINDS)
def test_drives_without_torque_at_the_start_wait_and_are_no_failure(fault: DriveFault) -> None:
    wired = Stopped(STO)
    wired.happen(ELBOW, fault)
    wired.start()
    wired.until(lambda: wired.drives.waiting_for_torque, 4.0)
    assert not wired.drives.failed
    assert wired.words()


def test_a_drive_with_a_fault_of_its_own_at_the_start_is_a_failure() -> None:
    wired = Wired(CanopenConfig(fault_reset=False))
    wired.happen(ELBOW, DriveFault.OVER_CURRENT)
    wired.start()
    wired.until(lambda: wired.drives.failed, 4.0)
    assert not wired.drives.waiting_for_torque


def test_codes_of_other_makers_are_configured() -> None:
    wired = Wired(CanopenConfig(sto_codes=[0x2310]))
    wired.up()
    wired.happen(ELBOW, DriveFault.OVER_CURRENT)
    wired.run(0.04)
    assert "over-current" in wired.drives.signs(ELBOW).torque_off
