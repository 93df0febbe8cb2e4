"""The adapter's own rules; what all buses must keep is in tests/contract."""

from __future__ import annotations

import asyncio
import errno
import logging
import socket
from collections.abc import Callable, Coroutine
from typing import Any

import can
import msgpack
import pytest
import uvloop

from common.can.bus import SEND_ERRORS_IN_A_ROW, CanBus
from common.can.config import BusConfig
from common.can.frame import CanFrame
from common.can.interface import open_bus
from common.can.kept_open import LONGEST_WAIT_S, wait_s
from common.errors import BusError

SYNC = CanFrame(0x080, b"1234", fd=False)
NODE = CanFrame(0x105, bytes(24), fd=True)


def run(test: Coroutine[Any, Any, None]) -> None:
    async def bounded() -> None:
        async with asyncio.timeout(30):
            await test

    uvloop.run(bounded())


class ScriptedBus(can.BusABC):
    """Fails as it is told to; hears nothing."""

    channel_info = "scripted"

    def __init__(self, send_error: Exception | None = None) -> None:
        super().__init__(channel="scripted")
        self.send_error = send_error
        self.heard: list[can.Message | Exception] = []
        self.sent = 0

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        assert timeout == 0, "a send must not wait"
        if self.send_error is not None:
            raise self.send_error
        self.sent += 1

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        if not self.heard:
            return None, True
        first = self.heard.pop(0)
        if isinstance(first, Exception):
            raise first
        return first, True


class Scene:
    """A CanBus on scripted buses; `opened` are those it was given."""

    def __init__(self, interface: str = "socketcan", opener: Callable[[], can.BusABC] | None = None) -> None:
        config = BusConfig(name="suit", interface=interface, channel="can0")
        self.opened: list[can.BusABC] = []
        self.frames: list[tuple[str, int, bytes]] = []
        self.stirred = asyncio.Event()
        self._open = opener or ScriptedBus
        self.bus = CanBus(config, self.on_frame, self.on_change, self.opener)

    def opener(self, config: BusConfig) -> can.BusABC:
        self.opened.append(self._open())
        return self.opened[-1]

    def on_frame(self, name: str, frame_id: int, data: bytes, now_ns: int) -> None:
        self.frames.append((name, frame_id, data))
        self.stirred.set()

    def on_change(self, name: str, up: bool) -> None:
        self.stirred.set()

    async def until(self, condition: Callable[[], bool]) -> None:
        while not condition():
            self.stirred.clear()
            await self.stirred.wait()


def test_the_wait_doubles_up_to_two_seconds() -> None:
    assert [wait_s(n) for n in range(7)] == [0.1, 0.2, 0.4, 0.8, 1.6, LONGEST_WAIT_S, LONGEST_WAIT_S]
    assert wait_s(10_000) == LONGEST_WAIT_S


@pytest.mark.parametrize("number", [errno.ENOBUFS, errno.EAGAIN, None])
def test_a_full_queue_is_counted_and_ends_the_bus_only_if_it_stays(number: int | None) -> None:
    async def test() -> None:
        full = can.CanOperationError("Transmit buffer full", number)
        scene = Scene(opener=lambda: ScriptedBus(full))
        scene.bus.open()
        for _ in range(SEND_ERRORS_IN_A_ROW - 1):
            scene.bus.send(SYNC)
        assert scene.bus.up
        scene.bus.send(SYNC)
        assert not scene.bus.up
        assert scene.bus.counters.send_errors == SEND_ERRORS_IN_A_ROW
        await scene.bus.close()

    run(test())


def test_one_send_that_works_starts_the_count_again() -> None:
    async def test() -> None:
        scene = Scene()
        scene.bus.open()
        wire = scene.opened[0]
        assert isinstance(wire, ScriptedBus)
        for _ in range(3):
            wire.send_error = can.CanOperationError("Transmit buffer full")
            for _ in range(SEND_ERRORS_IN_A_ROW - 1):
                scene.bus.send(SYNC)
            wire.send_error = None
            scene.bus.send(SYNC)
        assert scene.bus.up
        assert scene.bus.counters.sent == 3
        await scene.bus.close()

    run(test())


@pytest.mark.parametrize(
    "error",
    [
        can.CanOperationError("gone", errno.ENETDOWN),
        OSError(errno.ENODEV, "gone"),
        RuntimeError("a driver's own"),
    ],
    ids=repr,
)
def test_any_other_send_error_ends_the_bus_and_is_never_raised(error: Exception) -> None:
    async def test() -> None:
        scene = Scene(opener=lambda: ScriptedBus(error))
        scene.bus.open()
        scene.bus.send(SYNC)
        assert not scene.bus.up
        assert scene.bus.counters.times_down == 1
        assert "sending failed" in scene.bus.last_error
        await scene.bus.close()

    run(test())


@pytest.mark.parametrize(
    "error", [can.CanOperationError("closed"), OSError(errno.ENODEV, "gone"), RuntimeError("?")], ids=repr
)
def test_an_error_of_receiving_reopens_the_bus(error: Exception) -> None:
    async def test() -> None:
        scene = Scene()
        scene.bus.open()
        first = scene.opened[0]
        assert isinstance(first, ScriptedBus)
        first.heard.append(error)
        await scene.until(lambda: not scene.bus.up)
        await scene.until(lambda: scene.bus.up)
        assert len(scene.opened) == 2
        assert scene.bus.counters.times_down == 1
        await scene.bus.close()

    run(test())


def test_frames_before_a_bus_off_in_one_batch_do_not_bring_the_bus_up_again() -> None:
    async def test() -> None:
        scene = Scene()
        scene.bus.open()
        changes: list[bool] = []
        scene.bus._on_change = lambda _, up: changes.append(up)
        bus_off = 0x2000_0000 | 0x40, bytes(8), 1
        scene.bus._on_batch([(0x105, b"before", 1), bus_off, (0x105, b"after", 1)])
        assert scene.frames == [("suit", 0x105, b"before")]
        assert changes == [False]
        assert scene.bus._doubtful, "only what comes after it is opened again shows that it works"
        assert scene.bus.counters.received == 1
        await scene.bus.close()

    run(test())


def test_bus_off_reopens_the_bus_and_says_what_to_set() -> None:
    async def test() -> None:
        scene = Scene()
        scene.bus.open()
        first = scene.opened[0]
        assert isinstance(first, ScriptedBus)
        first.heard.append(
            can.Message(arbitration_id=0x40, is_extended_id=False, is_error_frame=True, data=bytes(8))
        )
        await scene.until(lambda: not scene.bus.up)
        assert "restart-ms" in scene.bus.last_error
        assert scene.bus.counters.error_frames == 1
        await scene.bus.close()

    run(test())


def test_open_says_why_it_cannot() -> None:
    async def test() -> None:
        def refuse() -> can.BusABC:
            raise BusError("bus suit: cannot open")

        scene = Scene(opener=refuse)
        with pytest.raises(BusError, match="cannot open"):
            scene.bus.open()
        assert not scene.bus.up
        await scene.bus.close()

    run(test())


def test_a_failed_reopening_is_counted_and_told_at_most_once_a_second(
    caplog: pytest.LogCaptureFixture,
) -> None:
    async def test() -> None:
        away = [False, True, True, False]

        def opener() -> can.BusABC:
            if away.pop(0):
                raise BusError("bus suit: still away")
            return ScriptedBus()

        scene = Scene(opener=lambda: scene_open())
        scene_open = opener
        scene.bus.open()
        wire = scene.opened[0]
        assert isinstance(wire, ScriptedBus)
        wire.send_error = OSError(errno.ENETDOWN, "down")
        scene.bus.send(SYNC)
        await scene.until(lambda: scene.bus.up)
        assert scene.bus.counters.failed_opens == 2
        assert caplog.text.count("still away") == 1
        await scene.bus.close()

    with caplog.at_level(logging.WARNING):
        run(test())


@pytest.fixture
def group() -> BusConfig:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("", 0))
        port = free.getsockname()[1]
    options: dict[str, str | int | float | bool] = {"port": port, "hop_limit": 0}
    return BusConfig(name="suit", interface="udp_multicast", channel="239.74.163.8", options=options)


def packed(**changes: object) -> bytes:
    """A frame as python-can's udp_multicast packs it, with something else in it."""
    fields: dict[str, object] = {
        "timestamp": 0.0,
        "arbitration_id": 0x105,
        "is_extended_id": False,
        "is_remote_frame": False,
        "is_error_frame": False,
        "channel": None,
        "dlc": 8,
        "data": bytes(8),
        "is_fd": False,
        "bitrate_switch": False,
        "error_state_indicator": False,
    }
    return bytes(msgpack.packb(fields | changes))


GARBAGE = [
    b"",
    b"\x00",
    b"\x93\x01\x02\x03",
    bytes(range(256)) * 8,
    packed()[:-3],
    packed() + b"more",
    packed(unknown=1),
    packed(dlc=7),
    packed(dlc="8"),
    packed(data="text"),
    packed(arbitration_id=-1),
    packed(arbitration_id=0x800),
    packed(arbitration_id=261.0),
    packed(arbitration_id=True),
    packed(arbitration_id="0x105"),
    packed(arbitration_id=64.0, is_error_frame=True),
]


def test_foreign_datagrams_are_counted_and_harm_nothing(group: BusConfig) -> None:
    async def test() -> None:
        heard: list[tuple[int, bytes]] = []
        good = asyncio.Event()

        def on_frame(name: str, frame_id: int, data: bytes, now_ns: int) -> None:
            heard.append((frame_id, data))
            good.set()

        bus = CanBus(group, on_frame)
        bus.open()
        peer = open_bus(group)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
            stranger.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, socket.inet_aton("127.0.0.1"))
            for datagram in GARBAGE:
                stranger.sendto(datagram, (group.channel, int(group.options["port"])))
        peer.send(can.Message(arbitration_id=0x105, is_extended_id=False, is_fd=True, data=bytes(24)))
        await good.wait()
        assert heard == [(0x105, bytes(24))]
        assert bus.counters.undecodable == len(GARBAGE)
        assert bus.up
        assert bus.counters.times_down == 0
        peer.shutdown()
        await bus.close()

    run(test())


def test_own_echo_is_told_apart_from_answers(group: BusConfig) -> None:
    async def test() -> None:
        heard: list[int] = []
        came = asyncio.Event()

        def on_frame(name: str, frame_id: int, data: bytes, now_ns: int) -> None:
            heard.append(frame_id)
            came.set()

        bus = CanBus(group, on_frame)
        bus.open()
        peer = open_bus(group)
        bus.send(SYNC)
        peer.send(can.Message(arbitration_id=NODE.id, is_extended_id=False, is_fd=True, data=NODE.data))
        await came.wait()
        assert heard == [NODE.id]
        assert bus.counters.own_heard == 1
        peer.shutdown()
        await bus.close()

    run(test())


def test_a_bus_that_is_not_there_at_the_start_is_opened_once_it_is(caplog: pytest.LogCaptureFixture) -> None:
    async def test() -> None:
        away = [True, True, False]

        def opener() -> can.BusABC:
            if away.pop(0):
                raise BusError("bus suit: cannot open socketcan can0: No such device")
            return ScriptedBus()

        scene = Scene(opener=opener)
        scene.bus.open_or_retry()
        assert not scene.bus.up
        assert "No such device" in scene.bus.last_error
        await scene.until(lambda: scene.bus.up)
        assert scene.bus.counters.failed_opens == 2
        await scene.bus.close()

    with caplog.at_level("WARNING"):
        run(test())
    assert "bus suit: cannot open socketcan can0: No such device; retrying" in caplog.text


def test_a_bus_that_no_waiting_can_open_is_an_error_at_once() -> None:
    async def test() -> None:
        def opener() -> can.BusABC:
            raise BusError("bus suit: no such interface") from NotImplementedError()

        scene = Scene(opener=opener)
        with pytest.raises(BusError, match="no such interface"):
            scene.bus.open_or_retry()
        await scene.bus.close()

    run(test())


def test_a_bus_that_never_opens_can_be_closed() -> None:
    async def test() -> None:
        def opener() -> can.BusABC:
            raise BusError("bus suit: away")

        scene = Scene(opener=opener)
        scene.bus.open_or_retry()
        await asyncio.wait_for(scene.bus.close(), 5.0)

    run(test())


@pytest.mark.parametrize(
    ("rare", "alone"),
    [(None, 0), (0x2000_0004, 2), (0x4000_0105, 2), (0x8000_0105, 2), (SYNC.id, 2)],
    ids=["none", "error", "remote", "29 bits", "own identifier"],
)
def test_frames_go_on_together_unless_a_rare_one_is_among_them(rare: int | None, alone: int) -> None:
    """What is rare is then taken out by the way that each frame takes alone."""

    async def test() -> None:
        scene, together = Scene(), []
        config = BusConfig(name="suit", interface="socketcan", channel="can0")
        bus = CanBus(
            config, scene.on_frame, opener=scene.opener, on_frames=lambda *heard: together.append(heard)
        )
        bus.open()
        bus.send(SYNC)
        frames = [(0x105, b"1", 1), *([] if rare is None else [(rare, bytes(8), 2)]), (0x106, b"2", 3)]
        bus._on_batch(frames)
        assert [frame_id for _, frame_id, _ in scene.frames] == [0x105, 0x106][:alone]
        assert together == ([("suit", frames)] if rare is None else [])
        assert bus.counters.received == 2
        await bus.close()

    run(test())
