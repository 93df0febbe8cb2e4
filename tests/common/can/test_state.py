"""A controller's state in words, by error frames and the kernel's own message; when a bus is up again."""

from __future__ import annotations

import asyncio
import contextlib
import struct
from collections.abc import Callable

import can
import pytest

from common.can.bus import CanBus
from common.can.config import BusConfig
from common.can.state import (
    Controller,
    Link,
    ask_kernel,
    bus_off_words,
    error_words,
    of_error_frame,
    read_link,
)
from common.errors import BusError
from tests.common.can.test_bus import ScriptedBus, run


@pytest.mark.parametrize(
    ("error_id", "detail", "state", "words"),
    [
        (0x004, 0x04, Controller.ERROR_WARNING, "the controller is error-warning"),
        (0x004, 0x08, Controller.ERROR_WARNING, "the controller is error-warning"),
        (0x004, 0x10, Controller.ERROR_PASSIVE, "the controller is error-passive"),
        (0x004, 0x2C, Controller.ERROR_PASSIVE, "the controller is error-passive"),
        (0x004, 0x40, Controller.ERROR_ACTIVE, "the controller is error-active"),
        (0x004, 0x01, None, "the controller lost frames that came in"),
        (0x040, 0x00, Controller.BUS_OFF, "the controller is bus-off"),
        (0x100, 0x00, Controller.ERROR_ACTIVE, "the controller was restarted"),
        (0x020, 0x00, None, "nobody acknowledges: no other node on the bus, or the wire is cut"),
        (0x008, 0x00, None, "frames are destroyed: look at the bit rate, the wiring, 120 Ω at both ends"),
        (0x001, 0x00, None, "error frame 0x1"),
    ],
)
def test_error_frames_in_words(error_id: int, detail: int, state: Controller | None, words: str) -> None:
    data = bytes([0, detail, 0, 0, 0, 0, 0, 0])
    assert of_error_frame(error_id, data) is state
    assert error_words(error_id, data) == words
    counted = bytes([0, detail, 0, 0, 0, 0, 130, 7])
    assert error_words(error_id | 0x200, counted).endswith("130 errors of sending and 7 of receiving counted")
    assert of_error_frame(error_id, b"") in (None, state)


def attribute(kind: int, data: bytes) -> bytes:
    return struct.pack("=HH", 4 + len(data), kind) + data + bytes(-len(data) % 4)


def newlink(state: int, restart_ms: int = 0, kind: int = 16) -> bytes:
    """As the kernel builds it: name, then linkinfo with the kind and the controller's data."""
    bittiming = struct.pack("=8I", 1_000_000, 750, 50, 7, 7, 5, 1, 1)
    told = attribute(1, bittiming) + attribute(4, struct.pack("=I", state))
    told += attribute(6, struct.pack("=I", restart_ms))
    info = attribute(1, b"can\0") + attribute(2, told)
    body = struct.pack("=BxHiII", 0, 280, 3, 0, 0) + attribute(3, b"can0\0") + attribute(18, info)
    return struct.pack("=IHHII", 16 + len(body), kind, 0, 1, 0) + body


@pytest.mark.parametrize(("number", "state"), list(enumerate(Controller)))
def test_the_kernel_s_message_is_read(number: int, state: Controller) -> None:
    assert read_link(newlink(number, 100)) == Link(state, 1_000_000, 100)


def test_messages_that_tell_nothing() -> None:
    assert read_link(newlink(0, kind=2)) is None
    assert read_link(newlink(9)) == Link(None, 1_000_000, 0)
    whole = newlink(3)
    for end in range(len(whole)):
        read_link(whole[:end])  # never raises
    assert ask_kernel("lo") is None
    assert ask_kernel("no-such-can") is None


def test_bus_off_says_how_the_controller_comes_back() -> None:
    assert "the kernel restarts it after 100 ms" in bus_off_words("can0", Link(Controller.BUS_OFF, 0, 100))
    assert "`ip link set can0 type can restart`" in bus_off_words("can0", Link(Controller.BUS_OFF))


class Story:
    """A bus whose controller stands as `state` says."""

    def __init__(self, state: Controller | None) -> None:
        self.state = state
        self.opened: list[ScriptedBus] = []
        self.changes: list[bool] = []
        self.asked = 0
        self.stirred = asyncio.Event()
        config = BusConfig(name="left", interface="socketcan", channel="can7")
        self.bus = CanBus(config, self._on_frame, self._on_change, self._open, state_of=self._state_of)

    def _open(self, config: BusConfig) -> can.BusABC:
        self.opened.append(ScriptedBus())
        return self.opened[-1]

    def _state_of(self, config: BusConfig, bus: can.BusABC) -> Controller | None:
        self.asked += 1
        return self.state

    def _on_frame(self, *_: object) -> None:
        self.stirred.set()

    def _on_change(self, name: str, up: bool) -> None:
        self.changes.append(up)
        self.stirred.set()

    def hear(self, frame_id: int, error: bool, data: bytes = bytes(8)) -> None:
        message = can.Message(arbitration_id=frame_id, is_extended_id=False, is_error_frame=error, data=data)
        self.opened[-1].heard.append(message)

    async def until(self, condition: Callable[[], bool]) -> None:
        while not condition():
            self.stirred.clear()
            with contextlib.suppress(TimeoutError):  # not every step stirs
                await asyncio.wait_for(self.stirred.wait(), 0.01)


def test_a_bus_is_not_up_again_while_its_controller_is_off(caplog: pytest.LogCaptureFixture) -> None:
    async def test() -> None:
        story = Story(Controller.ERROR_ACTIVE)
        story.bus.open()
        story.hear(0x40, error=True)
        story.state = Controller.BUS_OFF
        await story.until(lambda: story.asked >= 3)
        assert not story.bus.up
        assert story.bus.state is Controller.BUS_OFF
        assert story.changes == [True, False]
        assert "up again" not in caplog.text
        assert story.bus.last_error.startswith("bus-off: the controller has left the bus")
        story.state = Controller.ERROR_ACTIVE
        await story.until(lambda: story.bus.up)
        assert story.changes == [True, False, True]
        await story.bus.close()

    run(test())


@pytest.mark.parametrize("error", [True, False])
def test_where_nothing_tells_the_state_a_frame_or_a_restart_shows_it(error: bool) -> None:
    async def test() -> None:
        story = Story(None)
        story.bus.open()
        story.hear(0x40, error=True)
        await story.until(lambda: len(story.opened) == 2 and story.bus._bus is not None)
        assert not story.bus.up
        assert story.changes == [True, False]
        story.hear(0x100 if error else 0x181, error)
        await story.until(lambda: story.bus.up)
        assert story.changes == [True, False, True]
        await story.bus.close()

    run(test())


def test_a_controller_that_is_off_at_the_start_is_told() -> None:
    async def test() -> None:
        with pytest.raises(BusError, match="bus left: bus-off"):
            Story(Controller.BUS_OFF).bus.open()

    run(test())


def test_error_passive_is_in_the_figures() -> None:
    async def test() -> None:
        story = Story(Controller.ERROR_ACTIVE)
        story.bus.open()
        story.hear(0x04, error=True, data=bytes([0, 0x20, 0, 0, 0, 0, 128, 0]))
        await story.until(lambda: story.bus.counters.error_frames == 1)
        assert story.bus.summary()["state"] == "error-passive"
        assert story.bus.up
        await story.bus.close()

    run(test())
