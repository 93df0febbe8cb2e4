"""A key of an input device: down while the contact is closed."""

from __future__ import annotations

import asyncio
import errno
import os
from collections.abc import Awaitable, Callable, Set

import pytest

from common.inputs.device import InputError
from slave.stop_inputs.config import StopInputConfig
from slave.stop_inputs.device import DeviceStop

CONFIG = StopInputConfig(name="box", source="device", device="button box", key="KEY_B")
KEY_B = 48


class Box:
    """A device whose keys a test moves; its descriptor is a pipe's, so that an event loop can wait for it."""

    path = "/dev/input/event7"

    def __init__(self) -> None:
        self.held = {KEY_B}
        self.events: list[tuple[int, int]] = []
        self.gone = False
        self._ends = os.pipe()

    def fileno(self) -> int:
        return self._ends[0]

    def read(self) -> tuple[list[tuple[int, int]], bool]:
        if self.gone:
            raise OSError(errno.ENODEV, "No such device")
        events, self.events = self.events, []
        return events, False

    def down(self) -> set[int]:
        return set(self.held)

    def close(self) -> None:
        for end in self._ends:
            os.close(end)


@pytest.fixture
def box() -> Box:
    return Box()


def told(box: Box | None, story: Callable[[DeviceStop], Awaitable[None]]) -> None:
    def give(device: str, codes: Set[int], grab: bool) -> Box:
        assert (device, set(codes)) == ("button box", {KEY_B})
        if box is None:
            raise InputError("no input device is named 'button box'")
        return box

    async def tell() -> None:
        now = iter(range(1000, 10**6))
        stop = DeviceStop(CONFIG, give, lambda: next(now))
        stop.start()
        try:
            await story(stop)
        finally:
            stop.stop()
            stop.stop()

    asyncio.run(tell())


def test_a_key_that_is_down_at_the_start_is_a_closed_contact(box: Box) -> None:
    async def story(stop: DeviceStop) -> None:
        level = stop.read()
        assert (level.on, level.changed_ns) == (True, 0)
        assert stop.read().read_ns > level.read_ns

    told(box, story)


def test_a_key_that_goes_up_is_an_open_one_though_its_event_was_lost(box: Box) -> None:
    async def story(stop: DeviceStop) -> None:
        box.held.clear()
        assert stop.read().on is False

    told(box, story)


def test_a_key_that_was_up_between_two_readings_has_changed(box: Box) -> None:
    async def story(stop: DeviceStop) -> None:
        assert stop.read().changed_ns == 0
        box.events = [(KEY_B, 0), (KEY_B, 1)]
        level = stop.read()
        assert (level.on, level.changed_ns) == (True, level.read_ns)

    told(box, story)


def test_a_device_that_is_unplugged_is_not_known(box: Box) -> None:
    async def story(stop: DeviceStop) -> None:
        box.gone = True
        level = stop.read()
        assert level.on is None
        assert "has gone (No such device)" in level.why

    told(box, story)


def test_a_device_that_is_not_there_says_so() -> None:
    async def story(stop: DeviceStop) -> None:
        assert stop.read().on is None
        assert "no input device is named" in stop.read().why

    told(None, story)
