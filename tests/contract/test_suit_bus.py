"""What every bus must keep, whatever carries it: virtual, udp_multicast, SocketCAN (vcan and Kvaser cards).

Nothing here needs numpy: the emulated processor of a kernel runner may be too old for it.
"""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable, Coroutine
from contextlib import asynccontextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import can
import pytest
import uvloop

from common.can.batch import BatchReader
from common.can.bus import CanBus
from common.can.config import BusConfig
from common.can.frame import EXTENDED, CanFrame
from common.clock import monotonic_ns
from tests.contract.other_makers import OtherMakers

if TYPE_CHECKING:
    from tests.contract.conftest import Wire

DEADLINE_S = 60.0
"""Only a broken bus needs it: the suite also runs on an emulated machine."""


def run(test: Coroutine[Any, Any, None]) -> None:
    """On the loop that the product uses."""

    async def bounded() -> None:
        async with asyncio.timeout(DEADLINE_S):
            await test

    uvloop.run(bounded())


class End:
    """One end of a wire: a CanBus and all it tells."""

    def __init__(self, wire: Wire, config: BusConfig, *, in_batches: bool = False) -> None:
        self.arrived_ns: list[int] = []
        self.frames: list[tuple[int, bytes]] = []
        self.changes: list[bool] = []
        self._stirred = asyncio.Event()
        self.bus = CanBus(
            config,
            self._on_frame,
            self._on_change,
            wire.open,
            take_extended=in_batches,
            in_batches=in_batches,
        )

    def _on_frame(self, name: str, frame_id: int, data: bytes, now_ns: int) -> None:
        assert name == self.bus.name
        assert now_ns > 0
        self.frames.append((frame_id, data))
        self.arrived_ns.append(now_ns)
        self._stirred.set()

    def _on_change(self, name: str, up: bool) -> None:
        assert name == self.bus.name
        self.changes.append(up)
        self._stirred.set()

    async def until(self, condition: Callable[[], bool]) -> None:
        """Wait for something that comes with a frame or a change of this end."""
        while not condition():
            self._stirred.clear()
            await self._stirred.wait()

    async def have(self, count: int) -> None:
        await self.until(lambda: len(self.frames) >= count)


@asynccontextmanager
async def both_ends(wire: Wire) -> AsyncIterator[tuple[End, End]]:
    near, far = End(wire, wire.near), End(wire, wire.far)
    near.bus.open()
    far.bus.open()
    try:
        yield near, far
    finally:
        await near.bus.close()
        await far.bus.close()


@asynccontextmanager
async def stranger(wire: Wire) -> AsyncIterator[can.BusABC]:
    """A third party at the far end, with plain python-can."""
    bus = wire.open(wire.far)
    try:
        yield bus
    finally:
        bus.shutdown()


def frames_of_all_lengths(fd: bool) -> list[CanFrame]:
    lengths = [*range(9), *((12, 16, 20, 24, 32, 48, 64) if fd else ())]
    return [CanFrame(0x101 + n, bytes((7 * n + k) % 256 for k in range(n)), fd) for n in lengths]


def test_frames_arrive_in_order_and_unchanged_both_ways(wire: Wire) -> None:
    async def test() -> None:
        async with both_ends(wire) as (near, far):
            for sender, receiver in ((far, near), (near, far)):
                # ids of its own for each direction: an end does not hear the ids that it sends
                sent = [
                    CanFrame(frame.id + (0x200 if sender is near else 0), frame.data, frame.fd)
                    for frame in frames_of_all_lengths(wire.fd) * 4
                ]
                for first in range(0, len(sent), 8):  # a CAN card's own queue holds 10
                    for frame in sent[first : first + 8]:
                        sender.bus.send(frame)
                    await receiver.have(min(first + 8, len(sent)))
                assert receiver.frames == [(frame.id, frame.data) for frame in sent]
                assert sender.bus.counters.sent == len(sent)
                assert sender.bus.counters.send_errors == 0

    run(test())


def heard(end: End, count: int) -> bool:
    return len(end.frames) >= count


async def read_until(end: End, condition: Callable[[], bool], every_s: float = 0.005) -> None:
    """As a master reads a bus of which it waits for no frame: once a tick."""
    while not condition():
        end.bus.read()
        await asyncio.sleep(every_s)


def test_frames_read_in_batches_are_the_same_and_have_their_times(wire: Wire) -> None:
    async def test() -> None:
        near, far = End(wire, wire.near, in_batches=True), End(wire, wire.far)
        near.bus.open()
        far.bus.open()
        try:
            sent = [*frames_of_all_lengths(wire.fd), CanFrame(0x12345 | EXTENDED, b"29 bits", fd=False)]
            began_ns = monotonic_ns()
            assert isinstance(near.bus._reader, BatchReader) == (wire.near.interface == "socketcan")
            for number, frame in enumerate(sent, 1):
                far.bus.send(frame)
                if number % 8 == 0 or number == len(sent):  # a CAN card's own queue holds 10
                    await read_until(near, partial(heard, near, number))
            assert near.frames == [(frame.id, frame.data) for frame in sent]
            assert near.bus.counters.received == len(sent)
            times = near.arrived_ns
            assert began_ns <= times[0]
            assert times == sorted(times)
            assert times[-1] <= monotonic_ns()
        finally:
            await near.bus.close()
            await far.bus.close()

    run(test())


@pytest.mark.parametrize("in_batches", [False, True])
def test_frames_of_other_makers_nodes_arrive(wire: Wire, in_batches: bool) -> None:
    """`tests/master/capture/test_on_bus.py` shows that they are decoded to what the nodes measured."""
    # as many as have every identifier some 20 times: an emulated kernel takes its time
    sent = OtherMakers.read(Path(__file__).with_name("other_makers.txt")).frames[:400]

    async def test() -> None:
        near, far = End(wire, wire.near, in_batches=in_batches), End(wire, wire.far)
        near.bus._take_extended = True
        near.bus.open()
        far.bus.open()
        try:
            for number, frame in enumerate(sent, 1):
                far.bus.send(frame)
                if number % 8 == 0 or number == len(sent):  # a CAN card's own queue holds 10
                    await read_until(near, partial(heard, near, number), 0.001)
            assert near.frames == [(frame.id, frame.data) for frame in sent]
        finally:
            await near.bus.close()
            await far.bus.close()

    run(test())


def test_what_is_no_data_frame_is_told_apart_in_a_batch_too(wire: Wire) -> None:
    async def test() -> None:
        near = End(wire, wire.near, in_batches=True)
        near.bus.open()
        try:
            async with stranger(wire) as other:
                other.send(can.Message(arbitration_id=0x101, is_extended_id=False, is_remote_frame=True))
                other.send(can.Message(arbitration_id=0x102, is_extended_id=False, data=b"good"))
                await read_until(near, lambda: bool(near.frames))
                assert near.frames == [(0x102, b"good")]
                assert near.bus.counters.foreign == 1
        finally:
            await near.bus.close()

    run(test())


def test_a_bus_read_in_batches_that_disappears_is_reopened(wire: Wire) -> None:
    async def test() -> None:
        near = End(wire, wire.near, in_batches=True)
        near.bus.open()
        try:
            wire.disappear()
            near.bus.send(CanFrame(0x080, b"lost", fd=False))
            await read_until(near, lambda: not near.bus.up)
            wire.come_back()
            await read_until(near, lambda: near.bus.up)
            assert near.changes[:3] == [True, False, True]
            async with stranger(wire) as other:
                other.send(can.Message(arbitration_id=0x102, is_extended_id=False, data=b"back"))
                await read_until(near, lambda: bool(near.frames))
        finally:
            await near.bus.close()

    run(test())


def test_an_end_does_not_hear_itself(wire: Wire) -> None:
    async def test() -> None:
        async with both_ends(wire) as (near, far):
            for number in range(5):
                near.bus.send(CanFrame(0x080, bytes([number]), fd=False))
            await far.have(5)
            far.bus.send(CanFrame(0x101, b"answer", wire.fd))
            await near.have(1)
            # the answer came after its own frames on the same wire, so these have been passed over
            assert near.frames == [(0x101, b"answer")]

    run(test())


def test_frames_of_no_suit_are_counted_and_not_handed_on(wire: Wire) -> None:
    async def test() -> None:
        async with both_ends(wire) as (near, _), stranger(wire) as other:
            other.send(can.Message(arbitration_id=0x123456, is_extended_id=True, data=b"29 bits"))
            other.send(can.Message(arbitration_id=0x101, is_extended_id=False, is_remote_frame=True))
            other.send(can.Message(arbitration_id=0x102, is_extended_id=False, data=b"good"))
            await near.have(1)
            assert near.frames == [(0x102, b"good")]
            assert near.bus.counters.foreign == 2
            assert near.bus.up

    run(test())


def test_a_bus_that_disappears_is_reopened_and_nothing_is_raised(wire: Wire) -> None:
    async def test() -> None:
        async with both_ends(wire) as (near, far):
            wire.disappear()
            near.bus.send(CanFrame(0x080, b"lost", fd=False))
            await near.until(lambda: not near.bus.up)
            near.bus.send(CanFrame(0x080, b"lost", fd=False))
            assert near.bus.counters.send_errors >= 1
            assert near.bus.counters.times_down == 1
            assert near.bus.last_error

            wire.come_back()
            await near.until(lambda: near.bus.up)
            await far.until(lambda: far.bus.up)
            assert near.changes[:3] == [True, False, True]
            before = len(near.frames)
            # the far end may not have noticed yet that its bus was away: it repeats itself until heard
            while len(near.frames) == before:
                far.bus.send(CanFrame(0x101, b"back", wire.fd))
                await asyncio.wait({asyncio.create_task(near.have(before + 1))}, timeout=0.2)
            assert near.frames[-1] == (0x101, b"back")

    run(test())


def test_a_bus_that_stays_away_does_not_hold_up_close(wire: Wire) -> None:
    async def test() -> None:
        async with both_ends(wire) as (near, _):
            wire.disappear()
            near.bus.send(CanFrame(0x080, b"lost", fd=False))
            await near.until(lambda: not near.bus.up)
            await near.bus.close()
            assert not near.bus.up
            wire.come_back()

    run(test())


def test_close_may_be_called_again_and_before_open(wire: Wire) -> None:
    async def test() -> None:
        end = End(wire, wire.near)
        end.bus.open()
        await end.bus.close()
        await end.bus.close()
        end.bus.send(CanFrame(0x080, b"late", fd=False))
        assert end.bus.counters.send_errors == 1
        await End(wire, wire.near).bus.close()

    run(test())


def test_an_error_frame_is_counted_and_not_handed_on(wire: Wire) -> None:
    if wire.near.channel != wire.far.channel:
        pytest.skip("an error frame is one controller's own word: none crosses a wire between two cards")

    async def test() -> None:
        async with both_ends(wire) as (near, _), stranger(wire) as other:
            protocol_violation = 0x008
            other.send(
                can.Message(
                    arbitration_id=protocol_violation,
                    is_extended_id=False,
                    is_error_frame=True,
                    data=bytes(8),
                )
            )
            other.send(can.Message(arbitration_id=0x102, is_extended_id=False, data=b"good"))
            await near.have(1)
            assert near.frames == [(0x102, b"good")]
            assert near.bus.counters.error_frames == 1
            assert near.bus.up

    run(test())
