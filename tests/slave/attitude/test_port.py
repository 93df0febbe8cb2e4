"""The instrument at a pseudo-terminal: frames in and out, rubbish between them, a port that goes away."""

from __future__ import annotations

import math
import queue
import threading
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from common.errors import RobotError
from common.wire.messages import BaseAttitude
from slave.attitude import port as port_module
from slave.attitude.config import BaseConfig
from slave.attitude.frame import FrameAngles, encode
from slave.attitude.port import FrameReader, FrameWriter, SerialBase, of_frame

PAPER = bytes.fromhex("FF 01 00 23 44 05 61")
WAIT_S = 20.0
"""A bound, not a duration: a frame that never comes fails the test."""
Frames = queue.Queue[tuple[FrameAngles, int]]


def until(so: Callable[[], bool]) -> bool:
    """Whether it becomes so, looked at again and again; a bound for what another thread does."""
    again = threading.Event()
    for _ in range(2000):
        if so():
            return True
        again.wait(WAIT_S / 2000)
    return False


@pytest.fixture
def frames() -> Frames:
    return queue.Queue()


@pytest.fixture
def reader(line: Any, frames: Frames) -> Iterator[FrameReader]:
    reader = FrameReader(line.port, 9600, lambda angles, now_ns: frames.put((angles, now_ns)), lambda: 42)
    reader.start()
    yield reader
    reader.stop()


def test_frames_are_read_through_rubbish_and_stamped(line: Any, frames: Frames, reader: FrameReader) -> None:
    line.send(b"boot v1.2\r\n" + PAPER[:4] + PAPER + b"\x00\x11" + encode(FrameAngles(0, None, 3599)))
    assert frames.get(timeout=WAIT_S) == (FrameAngles(100, 2344, 561), 42)
    assert frames.get(timeout=WAIT_S) == (FrameAngles(0, None, 3599), 42)
    counters = reader.counters()
    assert counters == {"frames": 2, "refused": 1, "garbage_bytes": 13, "port_failures": 0}


def test_a_frame_in_pieces_is_one(line: Any, frames: Frames, reader: FrameReader) -> None:
    for byte in PAPER:
        line.send(bytes([byte]))
    assert frames.get(timeout=WAIT_S)[0] == FrameAngles(100, 2344, 561)


def test_what_is_written_is_the_frame(line: Any) -> None:
    writer = FrameWriter(line.port, 9600)
    writer.write(FrameAngles(100, 2344, 561))
    assert line.receive(7) == PAPER
    writer.close()


def test_a_port_that_is_not_there_is_refused_in_words() -> None:
    for opens in (
        FrameReader("/dev/no-such-port", 9600, lambda *_: None).start,
        lambda: FrameWriter("/dev/no-such-port", 9600),
    ):
        with pytest.raises(RobotError, match="/dev/no-such-port does not open") as caught:
            opens()
        assert "simulate" in str(caught.value)


def test_started_twice_is_refused_and_stopped_twice_is_not(reader: FrameReader) -> None:
    with pytest.raises(RobotError, match="already"):
        reader.start()
    reader.stop()
    reader.stop()


def test_a_port_that_goes_away_is_opened_again(
    line: Any, frames: Frames, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Unplugged:
        in_waiting = 0

        def read(self, _: int) -> bytes:
            raise OSError("device disconnected")

        def close(self) -> None: ...

    opened = port_module.open_port
    ports: list[Any] = [Unplugged(), None, Unplugged()]

    def plugged_in_later(port: str, baud: int) -> Any:
        if not ports:
            return opened(port, baud)
        found = ports.pop(0)
        if found is None:
            raise RobotError("not there")
        return found

    monkeypatch.setattr(port_module, "open_port", plugged_in_later)
    monkeypatch.setattr(port_module, "_AGAIN_S", 0.0)
    reader = FrameReader(line.port, 9600, lambda angles, now_ns: frames.put((angles, now_ns)))
    reader.start()
    try:
        # what was sent before it opened is dropped as old
        assert until(lambda: line.send(PAPER) or not frames.empty())
        assert frames.get()[0] == FrameAngles(100, 2344, 561)
        assert reader.counters()["port_failures"] == 3
    finally:
        reader.stop()


def test_the_base_keeps_its_last_attitude_with_its_age(line: Any) -> None:
    config = BaseConfig(source="serial", port=line.port, declination_deg=-2.5)
    base = SerialBase(config, clock=lambda: 5)
    assert base.read() is None
    base.start()
    try:
        line.send(3 * encode(FrameAngles(850, 10, 3540)))
        wanted = BaseAttitude(5, math.radians(85.0), math.radians(358.5), math.radians(354.0), 0.0)
        assert until(lambda: base.read() is not None)
        found = base.read()
        assert found is not None
        assert found.measured_ns == wanted.measured_ns
        assert found.inclination_rad == pytest.approx(wanted.inclination_rad)
        assert found.azimuth_rad == pytest.approx(wanted.azimuth_rad)
        assert found.tool_face_rad == pytest.approx(wanted.tool_face_rad)
        # pitched by 5° and rolled by 6°: cos tilt = sin 85° cos 6°
        assert math.cos(found.tilt_rad) == pytest.approx(
            math.sin(math.radians(85.0)) * math.cos(math.radians(6.0))
        )
    finally:
        base.stop()
    assert base.read() is found


def test_a_frame_without_a_tool_face_leaves_the_next_axis_open() -> None:
    config = BaseConfig(source="serial", port="x")
    assert of_frame(FrameAngles(900, 0, None), 1, config) is None
    upward = of_frame(FrameAngles(900, 0, None), 1, BaseConfig(source="serial", port="x", axis="up"))
    assert upward is not None
    assert upward.tilt_rad == pytest.approx(math.pi / 2)


def test_another_azimuth_near_the_vertical_is_not_passed_on() -> None:
    found = of_frame(FrameAngles(30, 1234, 567), 1, BaseConfig(source="serial", port="x", axis="up"))
    assert found is not None
    assert found.azimuth_rad is None
    assert found.tool_face_rad == pytest.approx(math.radians(56.7))
    assert found.tilt_rad == pytest.approx(math.radians(3.0))


def test_the_level_tool_face_is_taken_off() -> None:
    config = BaseConfig(source="serial", port="x", level_tool_face_deg=90.0)
    found = of_frame(FrameAngles(900, 0, 850), 1, config)
    assert found is not None
    assert found.tool_face_rad == pytest.approx(math.radians(355.0))
    assert found.tilt_rad == pytest.approx(math.radians(5.0))
