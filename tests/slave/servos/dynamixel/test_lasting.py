"""Nothing that lasts is written without a person's word, nothing before a refusal, and late is not silent."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from common.errors import RobotError
from slave.servos.dynamixel import registers as x
from slave.servos.dynamixel.latency import advice, timer_ms, too_late
from slave.servos.dynamixel.setup import SetUp, set_up

if TYPE_CHECKING:
    from tests.slave.servos.dynamixel.conftest import Rig


def watch(rig: Rig) -> list[tuple[int, int]]:
    """Every (servo, address) that is written from now on."""
    written: list[tuple[int, int]] = []
    for servo in rig.servos:

        def noted(address: int, data: bytes, servo: Any = servo, write: Any = servo.write) -> int:
            written.append((servo.id, address))
            return int(write(address, data))

        servo.write = noted  # type: ignore[method-assign]
    return written


def look(rig: Rig, write: bool) -> SetUp:
    return set_up(rig.config, rig.skeleton, rig.encoder_config, write)


def test_a_start_refuses_what_differs_by_name_and_writes_nothing(rig: Rig) -> None:
    rig.servos[0].put(x.OPERATING_MODE, 4)
    rig.servos[2].put(x.HOMING_OFFSET, -300)
    rig.servos[3].put(x.MODEL, 12)
    written = watch(rig)
    with pytest.raises(RobotError) as raised:
        rig.driver.start()
    assert "operating mode (address 11) is 4, must be 3" in str(raised.value)
    assert "homing offset (address 20) is -300, must be 0" in str(raised.value)
    assert "with --write replaces it" in str(raised.value)
    assert written == []


def test_a_start_of_sound_servos_writes_nothing_that_lasts(rig: Rig) -> None:
    written = watch(rig)
    rig.driver.start()
    assert {address for _, address in written} <= set(range(64, 147))


def test_a_reset_of_one_that_was_exchanged_writes_nothing_that_lasts(rig: Rig) -> None:
    rig.driver.start()
    rig.servos[4].put(x.TORQUE, 0)
    rig.cycles(len(rig.names) + 1)
    rig.servos[4].put(x.DRIVE_MODE, 1)
    written = watch(rig)
    rig.driver.recover()
    assert "drive mode (address 10) is 1, must be 0" in rig.driver.faults[rig.names[4]]
    assert [row for row in written if row[0] == rig.ids[rig.names[4]]] == []


def test_looking_writes_nothing_that_lasts_and_tells_what_differs(rig: Rig) -> None:
    rig.servos[1].put(x.RETURN_DELAY, 250)
    rig.servos[5].put(x.STATUS_RETURN, 0)
    written = watch(rig)
    found = look(rig, write=False)
    assert [d.words for d in found.servos[1].different] == ["return delay time (address 9) is 250, must be 0"]
    assert not any(looked.wrong or looked.written for looked in found.servos)
    assert written == [(rig.ids[rig.names[5]], x.STATUS_RETURN.address)]


def test_with_write_it_is_replaced_and_what_was_is_kept_in_the_report(
    rig: Rig, caplog: pytest.LogCaptureFixture
) -> None:
    rig.servos[0].put(x.STATUS_RETURN, 0)  # one that is silent is enough: each wait for it is a real one
    for servo in rig.servos:
        servo.put(x.HOMING_OFFSET, -300)
        servo.put(x.DRIVE_MODE, 1)
        servo.put(x.OPERATING_MODE, 4)
    found = look(rig, write=True)
    assert all(looked.written and not looked.wrong for looked in found.servos)
    assert [d.found for d in found.servos[0].different] == [1, 4, -300]
    assert "operating mode (address 11) changed permanently from 4 to 3" in caplog.text
    assert not any(looked.different for looked in look(rig, write=True).servos)
    rig.driver.start()


def test_one_that_is_refused_keeps_all_from_being_written(rig: Rig) -> None:
    for servo in rig.servos:
        servo.put(x.OPERATING_MODE, 4)
    rig.servos[3].put(x.TORQUE, 1)
    written = watch(rig)
    found = look(rig, write=True)
    assert "support the robot" in found.servos[3].wrong
    assert not any(looked.written for looked in found.servos)
    assert written == []


def test_answers_that_come_late_are_not_called_silence(make_rig: Callable[..., Rig]) -> None:
    """An adapter whose latency timer is at its 16 ms, and a driver that waits for 4."""
    rig = make_rig(reply_timeout_s=0.004)

    def late(answer: bytes) -> bytes:
        time.sleep(0.017)
        return answer

    rig.port.garble = late
    written = watch(rig)
    with pytest.raises(RobotError, match=r"quickest answer takes \d+\.\d ms, .* waits 4\.0 ms: .*latency"):
        rig.driver.start()
    assert written == []


def test_answers_that_become_late_are_named_so(make_rig: Callable[..., Rig]) -> None:
    rig = make_rig()
    rig.driver.start()
    rig.wait_for_answers(0.001)

    def late(answer: bytes) -> bytes:
        time.sleep(0.02)
        return answer

    rig.port.garble = late
    for _ in range(200):
        rig.cycles(1)
        if rig.driver.faults:
            break
        time.sleep(0.05)  # the cycle's own time: the late answers come within the next one
    said = list(rig.driver.faults.values())
    assert said
    assert all("answers too late" in words and "latency timer" in words for words in said)


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    folder = tmp_path / "sys/bus/usb-serial/devices/ttyUSB3"
    folder.mkdir(parents=True)
    (folder / "latency_timer").write_text("16\n")
    (tmp_path / "dev/serial/by-id").mkdir(parents=True)
    (tmp_path / "dev/ttyUSB3").touch()
    (tmp_path / "dev/serial/by-id/usb-FTDI").symlink_to("../../ttyUSB3")
    return tmp_path


def test_the_timer_is_found_by_lasting_names_too(tree: Path) -> None:
    assert timer_ms("/dev/ttyUSB3", tree) == 16
    assert timer_ms("/dev/serial/by-id/usb-FTDI", tree) == 16
    assert timer_ms("/dev/ttyACM0", tree) is None


def test_the_advice_names_timer_and_file(tree: Path) -> None:
    words = too_late("/dev/ttyUSB3", 0.0162, 0.004, tree)
    assert "16.2 ms" in words
    assert "the latency timer of ttyUSB3 is 16 ms: set it to 1 ms" in words
    assert "/sys/bus/usb-serial/devices/ttyUSB3/latency_timer" in words
    assert too_late("/dev/ttyUSB3", 0.004, 0.004, tree) == ""
    assert "raise servos.dynamixel.reply_timeout_s" in advice("/dev/ttyUSB3", 1)
