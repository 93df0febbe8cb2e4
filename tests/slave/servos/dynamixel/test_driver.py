"""The servos of a hand over a pseudo-terminal, cycle by cycle: no jump, no silence, no lie."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from common.errors import RobotError
from slave.servos.dynamixel import registers as x
from slave.servos.dynamixel.driver import Driver
from tests.slave.servos.dynamixel.simulated.packets import STATUS, frame
from tests.slave.servos.dynamixel.simulated.pty import SimulatedPort

if TYPE_CHECKING:
    from tests.slave.servos.dynamixel.conftest import Rig

COUNT_RAD = 2 * np.pi / 4096


def test_it_starts_where_it_stands(rig: Rig) -> None:
    # goals from before, and with the torque off: they must not count
    for servo in rig.servos:
        servo.put(x.GOAL_POSITION, 3000)
    rig.driver.start()
    for _ in range(10):
        rig.cycles(1)
        assert np.abs(rig.measured_rad - rig.start_rad).max() <= COUNT_RAD
    assert rig.driver.faults == {}
    assert rig.driver.reading.valid.all()
    for servo in rig.servos:
        assert servo.get(x.TORQUE) == 1
        assert servo.get(x.RETURN_DELAY) == 0
        assert servo.get(x.BUS_WATCHDOG) == 5
        assert servo.get(x.PROFILE_VELOCITY) == rig.driver._servos[0].velocity


def test_it_goes_where_it_is_told_reversed_or_not(rig: Rig) -> None:
    rig.driver.start()
    target = np.linspace(0.05, 0.6, len(rig.names))
    rig.cycles(60, target)
    assert np.abs(rig.measured_rad - target).max() <= COUNT_RAD
    # a servo's own limits stand outside the table's, so only those are met
    rig.cycles(150, np.full(len(rig.names), 9.0))
    assert np.abs(rig.measured_rad - rig.skeleton.upper_rad).max() <= COUNT_RAD


def test_a_servo_that_holds_already_never_lets_go(rig: Rig) -> None:
    rig.driver.start()
    rig.driver.close()
    offs = []
    for servo in rig.servos:
        write = servo.write

        def watched(address: int, data: bytes, write: Callable[[int, bytes], int] = write) -> int:
            offs.append((address, data)) if address == x.TORQUE.address else None
            return write(address, data)

        servo.write = watched  # type: ignore[method-assign]
    again = Driver(rig.config, rig.skeleton, rig.encoder_config, rig.clock)
    again.start()
    again.close()
    assert offs == []
    assert all(servo.get(x.TORQUE) for servo in rig.servos)
    assert all(servo.get(x.BUS_WATCHDOG) == 0 for servo in rig.servos)


def test_a_start_names_every_servo_that_cannot_be_used_and_why(rig: Rig) -> None:
    rig.servos[0].put(x.MODEL, 12)
    rig.servos[1].put(x.FIRMWARE, 37)
    rig.servos[2].fail(0x24)
    rig.servos[3].position = 4000.0
    rig.servos[4].put(x.OPERATING_MODE, 1)
    with pytest.raises(RobotError) as raised:
        rig.driver.start()
    text = str(raised.value)
    assert "5 of 14 servos" in text
    for j, words in enumerate(
        [
            "not of the X series",
            "no bus watchdog",
            "overheated, overloaded",
            "beyond its range",
            "operating mode",
        ]
    ):
        assert f"{rig.names[j]} (id {rig.ids[rig.names[j]]})" in text
        assert words in text
    # and it let go of the port
    rig.servos[0].put(x.MODEL, 1020)
    Driver(rig.config, rig.skeleton, rig.encoder_config, rig.clock)._open().close()


def test_a_servo_that_answers_nothing_is_named(make_rig: Callable[..., Rig]) -> None:
    rig = make_rig(reply_timeout_s=0.1)
    rig.servos[5].silent = True
    with pytest.raises(RobotError, match=rf"{rig.names[5]} \(id 15\): it does not answer"):
        rig.driver.start()


def test_a_silent_encoder_is_held_and_named_and_the_others_read(rig: Rig) -> None:
    rig.driver.start()
    rig.cycles(2)
    rig.wait_for_answers(0.4)
    rig.servos[6].silent = True
    rig.cycles(4)
    assert rig.driver.faults == {}
    expected = np.ones(len(rig.names), np.bool_)
    expected[6] = False
    assert (rig.driver.reading.valid == expected).all()
    rig.cycles(1)
    assert rig.driver.faults == {rig.names[6]: "servo 16 does not answer"}
    assert rig.driver.missed == 5
    # it costs no more waiting, and the others go on
    target = np.full(len(rig.names), 0.5)
    rig.cycles(40, target)
    assert rig.driver.missed == 5
    assert np.abs(rig.measured_rad - target)[expected].max() <= COUNT_RAD


def test_one_that_comes_back_waits_for_a_reset_and_then_moves_slowly(rig: Rig) -> None:
    rig.driver.start()
    rig.wait_for_answers(0.4)
    servo, name = rig.servos[6], rig.names[6]
    servo.silent = True
    rig.cycles(6)
    servo.power_cycle()
    servo.silent = False
    target = np.full(len(rig.names), 0.7)
    rig.cycles(20, target)
    assert "torque is off" in rig.driver.faults[name]
    rig.driver.recover()
    assert rig.driver.faults == {}
    before = rig.measured_rad[6]
    assert before == pytest.approx(0.2, abs=2 * COUNT_RAD)
    speeds = []
    for _ in range(120):
        rig.cycles(1, target)
        speeds.append((rig.measured_rad[6] - before) / 0.01)
        before = rig.measured_rad[6]
    assert rig.measured_rad[6] == pytest.approx(0.7, abs=COUNT_RAD)
    # whole counts a cycle: the mean of five tells the speed to a fifth of a count
    assert np.convolve(speeds, np.ones(5) / 5, "valid").max() <= 0.5 + 0.2 * COUNT_RAD / 0.01


def test_a_hardware_error_is_told_in_words_at_once(rig: Rig) -> None:
    rig.driver.start()
    rig.cycles(2)
    rig.servos[9].fail(0x04)
    # the alert in its answer brings its turn forward
    rig.cycles(1)
    assert "overheated" in rig.driver.faults[rig.names[9]]
    rig.driver.recover()
    assert "overheated" in rig.driver.faults[rig.names[9]]
    rig.servos[9].power_cycle()
    rig.driver.recover()
    assert rig.driver.faults == {}


def test_a_torque_that_went_off_unnoticed_is_found_within_a_round(rig: Rig) -> None:
    rig.driver.start()
    rig.servos[3].power_cycle()
    rig.cycles(len(rig.names))
    assert rig.driver.faults == {rig.names[3]: "its torque is off, as after a loss of power"}


def test_a_quick_stop_holds_where_the_servos_are_whatever_is_written(rig: Rig) -> None:
    rig.driver.start()
    target = np.full(len(rig.names), 0.8)
    rig.cycles(8, target)
    moving = rig.measured_rad
    assert (moving > 0.25).all()
    assert (moving < 0.75).all()
    rig.cycles(30, target, stop=True)
    stopped = rig.measured_rad
    # within the way that they roll on for
    assert (stopped >= moving - 2 * COUNT_RAD).all()
    assert (stopped - moving).max() < 0.15
    rig.cycles(30, -target, stop=True)
    assert (rig.measured_rad == stopped).all()
    assert all(servo.get(x.TORQUE) for servo in rig.servos)
    # and afterwards it does not fly to what was written meanwhile
    rig.driver.recover()
    rig.cycles(4, target)
    assert np.abs(rig.measured_rad - stopped).max() < 0.5 * 0.04 + 2 * COUNT_RAD


def test_when_the_slave_is_dead_the_servos_stop_by_themselves(rig: Rig) -> None:
    rig.driver.start()
    rig.cycles(5, np.full(len(rig.names), 0.8))
    with rig.port.lock:
        rig.now_ns += 101_000_000
        rig.bus.advance(rig.now_ns)
        assert all(servo.get(x.BUS_WATCHDOG) == x.WATCHDOG_TRIPPED for servo in rig.servos)
        where = [servo.position for servo in rig.servos]
    # a slave that was only asleep says so, and moves nothing until a reset
    rig.cycles(1, np.full(len(rig.names), 0.8))
    assert set(rig.driver.faults) == set(rig.names)
    rig.cycles(20, np.full(len(rig.names), 0.8))
    assert [servo.position for servo in rig.servos] == pytest.approx(where, abs=0.6)
    assert all("stopped by itself" in words for words in rig.driver.faults.values())
    assert set(rig.driver.faults) == set(rig.names)
    rig.driver.recover()
    assert rig.driver.faults == {}
    rig.cycles(150, np.full(len(rig.names), 0.8))
    assert np.abs(rig.measured_rad - 0.8).max() <= COUNT_RAD


def test_a_new_slave_does_not_finish_what_a_dead_one_began(make_rig: Callable[..., Rig]) -> None:
    rig = make_rig(bus_watchdog_s=0.04)
    rig.driver.start()
    rig.cycles(2, np.full(len(rig.names), 0.8))
    with rig.port.lock:
        rig.now_ns += 150_000_000
        rig.bus.advance(rig.now_ns)
    rig.driver._drop()
    # far from where they were going
    assert all(abs(servo.position - servo.get(x.GOAL_POSITION)) > 50 for servo in rig.servos)
    where = [servo.position for servo in rig.servos]
    rig.driver = Driver(rig.config, rig.skeleton, rig.encoder_config, rig.clock)
    rig.driver.start()
    for _ in range(10):
        rig.cycles(1)
        assert [servo.position for servo in rig.servos] == pytest.approx(where, abs=0.6)
    assert rig.driver.faults == {}
    # the stop had lifted the servos' own velocity limit
    assert all(servo.get(x.PROFILE_VELOCITY) for servo in rig.servos)


def test_a_servo_past_the_end_of_its_turn_does_not_go_round(make_rig: Callable[..., Rig]) -> None:
    rig = make_rig()
    rig.driver.start()
    rig.servos[0].position = -2.0
    rig.servos[0].put(x.TORQUE, 0)
    rig.cycles(1)
    assert rig.driver.reading.counts[0] == 4094
    rig.cycles(1, stop=True)
    assert rig.driver._goals.counts[0] == rig.driver._servos[0].lowest


def test_a_pulled_cable_faults_all_and_a_new_one_works_after_a_reset(rig: Rig) -> None:
    opened = []
    open_port = rig.driver._open_port

    def open_again(*args: Any) -> Any:
        opened.append(rig.now_ns)
        return open_port(*args)

    rig.driver._open_port = open_again
    rig.driver.start()
    rig.cycles(3)
    rig.port.pull()
    rig.cycles(1)
    assert set(rig.driver.faults) == set(rig.names)
    assert "port lost" in rig.driver.faults[rig.names[0]]
    assert not rig.driver.reading.valid.any()
    rig.cycles(250)
    assert rig.driver.lost == 1
    # tried again after 0.1, 0.2, 0.4, 0.8 s
    assert len(opened) == 1 + 4
    with SimulatedPort(rig.bus, clock=rig.clock) as port:
        rig.driver._config = rig.config.model_copy(update={"port": port.device})
        rig.cycles(250)
        assert rig.driver.reading.valid.all()
        assert "until an e-stop is reset" in rig.driver.faults[rig.names[0]]
        rig.driver.recover()
        assert rig.driver.faults == {}
        rig.driver.close()


def test_answers_that_a_bad_cable_breaks_are_dropped_and_counted(rig: Rig) -> None:
    rig.driver.start()
    rig.cycles(2)
    rig.wait_for_answers(0.1)
    draw = np.random.default_rng(5)

    def garble(answer: bytes) -> bytes:
        broken = bytearray(answer)
        for _ in range(len(answer) // 40):
            broken[draw.integers(len(broken))] ^= int(draw.integers(1, 256))
        return bytes(broken[: draw.integers(1, len(broken) + 1)] if draw.random() < 0.2 else broken)

    rig.port.garble = garble
    for _ in range(30):
        rig.cycles(1)
        reading = rig.driver.reading
        # what is valid is true; what is broken is not valid
        assert np.abs(rig.measured_rad - rig.start_rad)[reading.valid].max(initial=0.0) <= COUNT_RAD
    assert rig.driver.missed > 0
    assert rig.driver.broken > 0


def test_an_answer_that_comes_late_is_never_taken_for_anothers(make_rig: Callable[..., Rig]) -> None:
    rig = make_rig(reply_timeout_s=0.1)
    held: list[bytes] = []
    count = 0

    def hold_back(answer: bytes) -> bytes:
        # every fifth answer comes only with the one after it
        nonlocal count
        count += 1
        if count % 5 == 0:
            held.append(answer)
            return b""
        return held.pop() + answer if held else answer

    rig.port.garble = hold_back
    rig.driver._servos = rig.driver._servos[:1]
    try:
        assert rig.driver._open() is not None
        assert rig.driver._prepare(rig.driver._servos, 0.1, inspected=False) == []
    finally:
        rig.driver.close()
    assert rig.servos[0].get(x.PROFILE_VELOCITY) == rig.driver._servos[0].velocity
    assert rig.servos[0].get(x.TORQUE) == 1


def test_a_health_that_comes_late_is_no_position(make_rig: Callable[..., Rig]) -> None:
    rig = make_rig()
    rig.driver.start()
    rig.wait_for_answers(0.1)
    held: list[bytes] = []

    def hold_back(answer: bytes) -> bytes:
        if len(answer) == 11 + x.HEALTH.size:
            held.append(answer)
            return b""
        # and somebody answers who was not asked
        return frame(200, STATUS, bytes(5)) + b"".join(held[-1:]) + answer

    rig.port.garble = hold_back
    for _ in range(len(rig.names) + 1):
        rig.cycles(1)
        assert np.abs(rig.measured_rad - rig.start_rad).max() <= COUNT_RAD
    assert len(held) >= len(rig.names)
