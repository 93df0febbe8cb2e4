"""The thread around the simulated robot: what only it can get wrong, without waiting on a real clock."""

import threading

import numpy as np
import pytest

from common.errors import RobotError
from common.skeleton import load_skeleton
from slave.backends import ServosConfig
from slave.encoders.counts import EncoderConfig
from slave.servos.contract import Subject, check
from slave.servos.mujoco.servos import MujocoServos
from slave.servos.mujoco.simulated import CYCLE_NS
from slave.servos.servos import EncoderReading

SKELETON = load_skeleton("nursing")
J = len(SKELETON.joints)


class StepClock:
    """Moves on by a cycle whenever it is read, so that the thread never has to sleep."""

    def __init__(self) -> None:
        self.now_ns = 1_000
        self.stands = False
        self.read = 0
        self.turned = threading.Semaphore(0)

    def __call__(self) -> int:
        if not self.stands:
            self.now_ns += CYCLE_NS
        self.read += 1
        self.turned.release()
        return self.now_ns

    def turns(self, count: int) -> None:
        """Wait until the thread has read it so often from now on."""
        until = self.read + count
        while self.read < until:
            assert self.turned.acquire(timeout=10.0)


def test_it_reads_before_it_is_started() -> None:
    reading = MujocoServos(SKELETON, clock=lambda: 5).read()
    assert reading.read_ns == 5
    assert reading.valid.all()


def test_what_is_written_is_where_it_goes_and_after_stop_it_stays() -> None:
    clock = StepClock()
    servos = MujocoServos(SKELETON, clock=clock)
    servos.start()
    try:
        servos.write(np.full(J, 0.2))
        clock.turns(1_000)
    finally:
        servos.stop()
    reading = servos.read()
    expected = round(0.2 / (2 * np.pi) * 4096)
    assert np.abs(reading.counts - expected).max() <= 4
    clock.stands = True
    assert servos.read() is reading
    assert not any(t.name == "mujoco" for t in threading.enumerate())


def test_readings_come_whole_and_in_order_while_the_loop_reads() -> None:
    clock = StepClock()
    servos = MujocoServos(SKELETON, clock=clock)
    servos.start()
    readings: list[EncoderReading] = []
    try:
        for _ in range(300):
            clock.turns(1)
            readings.append(servos.read())
    finally:
        servos.stop()
    times = [r.read_ns for r in readings]
    assert times == sorted(times)
    assert times[-1] > times[0]


def test_time_in_which_it_was_stopped_is_not_caught_up() -> None:
    clock = StepClock()
    servos = MujocoServos(SKELETON, clock=clock)
    clock.now_ns += 3_600_000_000_000
    servos.start()
    clock.turns(20)
    servos.stop()
    assert servos.skipped_cycles == 0


def test_stopping_twice_is_harmless_and_starting_twice_is_an_error() -> None:
    servos = MujocoServos(SKELETON, clock=StepClock())
    servos.stop()
    servos.start()
    try:
        with pytest.raises(RobotError, match="runs already"):
            servos.start()
    finally:
        servos.stop()
        servos.stop()
    servos.start()
    servos.stop()


def test_a_setpoint_that_is_none_is_refused_where_it_is_written() -> None:
    with pytest.raises(ValueError, match="25 finite angles"):
        MujocoServos(SKELETON).write(np.full(J, np.nan))


def test_it_keeps_the_contract_of_all_backends() -> None:
    clock = StepClock()
    servos = MujocoServos(SKELETON, clock=clock)
    check(Subject(servos, SKELETON, EncoderConfig(), pass_time=lambda: clock.turns(2)))


def test_the_configuration_opens_it() -> None:
    assert isinstance(ServosConfig().open(SKELETON, EncoderConfig()), MujocoServos)
