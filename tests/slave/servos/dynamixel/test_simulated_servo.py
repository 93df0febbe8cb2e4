"""What an X series servo refuses, when it stops by itself, how it moves."""

from __future__ import annotations

import pytest

from slave.servos.dynamixel import registers as x
from slave.servos.dynamixel.registers import Register
from tests.slave.servos.dynamixel.simulated.bus import SimulatedBus
from tests.slave.servos.dynamixel.simulated.packets import (
    BROADCAST,
    PING,
    READ,
    SYNC_READ,
    SYNC_WRITE,
    WRITE,
    Parser,
    frame,
)
from tests.slave.servos.dynamixel.simulated.servo import ACCESS, LIMIT, OK, SimulatedServo

MS = 1_000_000


def set_register(servo: SimulatedServo, register: Register, value: int) -> int:
    return servo.write(register.address, register.encode(value))


def answers(data: bytes) -> list[tuple[int, int, bytes]]:
    return [(p.servo, p.parameters[0], p.parameters[1:]) for p in Parser().feed(data)]


@pytest.fixture
def servo() -> SimulatedServo:
    servo = SimulatedServo(1, position=2000)
    assert set_register(servo, x.TORQUE, 1) == OK
    servo.advance(0)
    return servo


def test_lasting_settings_are_locked_while_the_torque_is_on(servo: SimulatedServo) -> None:
    assert set_register(servo, x.OPERATING_MODE, 1) == ACCESS
    set_register(servo, x.TORQUE, 0)
    assert set_register(servo, x.OPERATING_MODE, 1) == OK


def test_a_goal_beyond_its_limits_is_refused(servo: SimulatedServo) -> None:
    assert set_register(servo, x.GOAL_POSITION, 4096) == LIMIT
    assert set_register(servo, x.GOAL_POSITION, -1) == LIMIT
    assert servo.get(x.GOAL_POSITION) == 2000


def test_it_goes_to_its_goal_no_faster_than_its_profile(servo: SimulatedServo) -> None:
    set_register(servo, x.PROFILE_VELOCITY, x.profile_velocity(1.0))
    set_register(servo, x.GOAL_POSITION, 3000)
    per_s = servo.get(x.PROFILE_VELOCITY) * x.RAD_S_PER_UNIT * 4096 / 6.283185307
    before = servo.position
    for i in range(1, 400):
        servo.advance(i * 10 * MS)
        assert abs(servo.position - before) <= per_s * 0.01 + 1e-9
        before = servo.position
    assert servo.position == pytest.approx(3000, abs=0.5)


def test_its_watchdog_stops_it_and_locks_its_goal(servo: SimulatedServo) -> None:
    set_register(servo, x.GOAL_POSITION, 3000)
    set_register(servo, x.BUS_WATCHDOG, 5)
    servo.heard(0)
    servo.advance(100 * MS)
    assert servo.get(x.BUS_WATCHDOG) == 5
    servo.advance(101 * MS)
    assert servo.get(x.BUS_WATCHDOG) == x.WATCHDOG_TRIPPED
    stopped = servo.position
    servo.advance(5_000 * MS)
    assert servo.position == pytest.approx(stopped, abs=0.5)
    assert set_register(servo, x.GOAL_POSITION, 2500) == LIMIT
    assert set_register(servo, x.BUS_WATCHDOG, 0) == OK
    assert set_register(servo, x.GOAL_POSITION, 2500) == OK


def test_a_hardware_error_lets_go_until_the_power_was_off(servo: SimulatedServo) -> None:
    servo.fail(0x20)
    assert servo.alert == 0x80
    assert set_register(servo, x.TORQUE, 1) == ACCESS
    servo.power_cycle()
    assert servo.alert == 0
    assert set_register(servo, x.TORQUE, 1) == OK


def test_one_bus_of_many() -> None:
    bus = SimulatedBus(SimulatedServo(i, 1000 + i) for i in (1, 2, 3))
    where = x.PRESENT_POSITION.address.to_bytes(2, "little") + b"\x04\x00"
    bus.servos[2].silent = True
    found = answers(bus.feed(frame(BROADCAST, SYNC_READ, where + bytes([3, 2, 1, 9])), 0))
    assert found == [(3, 0, x.PRESENT_POSITION.encode(1003)), (1, 0, x.PRESENT_POSITION.encode(1001))]
    assert [s for s, _, _ in answers(bus.feed(frame(BROADCAST, PING), 0))] == [1, 3]
    assert bus.feed(frame(BROADCAST, READ, where), 0) == b""
    goal = x.GOAL_POSITION.address.to_bytes(2, "little") + b"\x04\x00"
    values = b"".join(bytes([i]) + x.GOAL_POSITION.encode(500 * i) for i in (1, 3))
    assert bus.feed(frame(BROADCAST, SYNC_WRITE, goal + values), 0) == b""
    assert [bus.servos[i].get(x.GOAL_POSITION) for i in (1, 2, 3)] == [500, 1002, 1500]


def test_a_servo_may_be_set_to_answer_less() -> None:
    bus = SimulatedBus([SimulatedServo(1)])
    write = frame(1, WRITE, x.PROFILE_VELOCITY.address.to_bytes(2, "little") + b"\x07\x00\x00\x00")
    read = frame(1, READ, x.PROFILE_VELOCITY.address.to_bytes(2, "little") + b"\x04\x00")
    for level, writes, reads in ((2, 1, 1), (1, 0, 1), (0, 0, 0)):
        bus.servos[1].put(x.STATUS_RETURN, level)
        assert len(answers(bus.feed(write, 0))) == writes
        assert len(answers(bus.feed(read, 0))) == reads
        assert len(answers(bus.feed(frame(1, PING), 0))) == 1
