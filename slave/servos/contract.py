"""What every servo backend must do. A backend's test makes a `Subject` and calls `check` with it.

It needs no test framework, so that another package's tests can use it: what is broken is an AssertionError.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from common.errors import RobotError
from common.metrics.slave import ServoMetrics
from common.quaternion import Array
from common.skeleton import Skeleton
from slave.encoders.counts import EncoderConfig, Encoders
from slave.servos import EncoderReading, Servos


@dataclass(frozen=True)
class Subject:
    """Servos that have not been started, with a robot behind them that is well."""

    servos: Servos
    skeleton: Skeleton
    encoders: EncoderConfig
    pass_time: Callable[[], object]
    """Lets the robot move on by some milliseconds, or waits for them."""
    near_rad: float = 0.01
    """A joint has arrived when it is this close to its setpoint."""
    most_turns: int = 5_000
    """So often `pass_time` is called at most until the joints have arrived."""

    def position_rad(self) -> Array:
        """(J,) by the newest reading."""
        return Encoders(self.skeleton, self.encoders).position_rad(self.servos.read().counts)

    def posture(self, share: float) -> Array:
        """(J,) a posture near the middle of every range."""
        low, high = self.skeleton.lower_rad, self.skeleton.upper_rad
        posture: Array = np.clip(
            np.full(len(low), share), low + 0.1 * (high - low), high - 0.1 * (high - low)
        )
        return posture

    def go(self, target_rad: Array) -> None:
        """Write a setpoint again and again, as the slave does, until the joints are there."""
        for _ in range(self.most_turns):
            self.servos.write(target_rad)
            self.pass_time()
            off = np.abs(self.position_rad() - target_rad)
            if off.max() < self.near_rad and self.servos.read().valid.all():
                return
        raise AssertionError(f"off by {off.round(3)}; faults {dict(self.servos.faults())}")


def _readings_are_well_formed(subject: Subject, reading: EncoderReading) -> None:
    joints = len(subject.skeleton.joints)
    assert reading.counts.shape == reading.valid.shape == (joints,)
    assert reading.counts.dtype == np.int64
    assert reading.valid.dtype == np.bool_
    assert reading.drive_rad is None or reading.drive_rad.shape == (joints,)
    assert reading.effort_nm is None or reading.effort_nm.shape == (joints,)
    good = reading.counts[reading.valid]
    assert ((good >= 0) & (good < 4096)).all()


def _they_hold_where_they_stand(subject: Subject) -> None:
    for _ in range(subject.most_turns):
        subject.pass_time()
        if subject.servos.read().valid.all():
            break
    before = subject.position_rad()
    for _ in range(20):
        subject.pass_time()
        assert np.abs(subject.position_rad() - before).max() < 0.05


def _they_go_where_they_are_sent(subject: Subject) -> None:
    subject.go(subject.posture(0.2))


def _readings_never_go_back_in_time(subject: Subject) -> None:
    times = []
    for _ in range(50):
        subject.pass_time()
        reading = subject.servos.read()
        _readings_are_well_formed(subject, reading)
        times.append(reading.read_ns)
    assert times == sorted(times)
    assert times[-1] > times[0]


def _a_setpoint_that_is_none_is_refused(subject: Subject) -> None:
    joints = len(subject.skeleton.joints)
    for wrong in (np.full(joints, np.nan), np.zeros(joints + 1)):
        try:
            subject.servos.write(wrong)
        except ValueError as error:
            said = str(error)
        else:
            said = "nothing"
        assert f"{joints} finite angles" in said, (
            f"says {said} of setpoints that are not {joints} finite angles"
        )


def _after_a_quick_stop_they_follow_again(subject: Subject) -> None:
    subject.servos.quick_stop(True)
    stands = subject.position_rad()
    for _ in range(20):
        # the guard's setpoint stands still during an e-stop
        subject.servos.write(stands)
        subject.pass_time()
    assert np.abs(subject.position_rad() - stands).max() < 0.05
    subject.servos.quick_stop(False)
    subject.go(subject.posture(0.1))


def _all_is_well(subject: Subject) -> None:
    assert dict(subject.servos.faults()) == {}
    assert isinstance(subject.servos.metrics(), ServoMetrics)


def _a_second_start_is_refused(servos: Servos) -> None:
    try:
        servos.start()
    except RobotError:
        return
    raise AssertionError("can be started twice: raise RobotError while they run")


def check(subject: Subject) -> None:
    """Start the servos, run every rule, stop them. Fails at the first rule that is broken."""
    servos = subject.servos
    _readings_are_well_formed(subject, servos.read())
    servos.stop()
    servos.start()
    try:
        _a_second_start_is_refused(servos)
        _they_hold_where_they_stand(subject)
        _they_go_where_they_are_sent(subject)
        _readings_never_go_back_in_time(subject)
        _a_setpoint_that_is_none_is_refused(subject)
        _after_a_quick_stop_they_follow_again(subject)
        _all_is_well(subject)
    finally:
        servos.stop()
        servos.stop()
