"""The reader against the kernel's own input devices, made by uinput."""

from __future__ import annotations

import asyncio
import os
import shutil
import subprocess
from collections.abc import Callable

import evdev
import pytest

from common.inputs.device import open_input
from common.inputs.held import HeldSwitch
from common.inputs.listing import list_devices
from common.inputs.reader import InputReader
from tests.common.inputs.pseudo import CLUTCH, PEDAL

pytestmark = pytest.mark.live
NAME = "tandem test pedal"
LIMIT_S = 30.0


@pytest.fixture(autouse=True)
def kernel_has_uinput() -> None:
    for module in ("evdev", "uinput"):  # built in, loaded or to be loaded
        if shutil.which("modprobe"):
            subprocess.run(["modprobe", "-q", module], check=False, stderr=subprocess.DEVNULL)
    if not os.access("/dev/uinput", os.W_OK):
        pytest.skip("this kernel has no uinput")


def plugged_in() -> evdev.UInput:
    return evdev.UInput({evdev.ecodes.EV_KEY: [PEDAL, CLUTCH]}, name=NAME, phys="test/input0")


def put(pedal: evdev.UInput, code: int, value: int) -> None:
    pedal.write(evdev.ecodes.EV_KEY, code, value)
    pedal.syn()


async def until(condition: Callable[[], bool]) -> None:
    async with asyncio.timeout(LIMIT_S):
        while not condition():  # noqa: ASYNC110 (the kernel is waited for)
            await asyncio.sleep(0.01)


def state(reader: InputReader, name: str = "KEY_B") -> bool | None:
    return reader.keys[name].at(0)


def test_a_pedal_is_found_pressed_released_unplugged_and_found_again() -> None:
    async def story() -> None:
        reader = InputReader(NAME, {"KEY_B": None, "KEY_C": None}, clock=lambda: 0)
        held = HeldSwitch()

        def look() -> bool:
            return held.take(state(reader), reader.keys["KEY_B"].releases)

        pedal = plugged_in()
        await until(lambda: NAME in {device.name for device in list_devices()})
        reader.start()
        try:
            await until(lambda: state(reader) is False)
            assert not look()
            put(pedal, PEDAL, 1)
            await until(look)
            assert state(reader, "KEY_C") is False
            pedal.close()
            await until(lambda: state(reader) is None)
            assert not look()
            pedal = plugged_in()
            put(pedal, PEDAL, 1)  # before the reader has found it: down when it is opened
            await until(lambda: state(reader) is True)
            assert not look()
            put(pedal, PEDAL, 0)
            put(pedal, PEDAL, 1)  # read at once with the release
            await until(look)
        finally:
            reader.close()
            pedal.close()

    asyncio.run(story())


def test_no_other_program_receives_the_key_and_none_can_take_it() -> None:
    pedal = plugged_in()
    try:
        path = next(device.path for device in list_devices() if device.name == NAME)
        other = evdev.InputDevice(path)
        mine = open_input(path, {PEDAL}, True)
        with pytest.raises(OSError, match="busy"):
            other.grab()
        put(pedal, PEDAL, 1)
        assert mine.down() == {PEDAL}
        assert other.read_one() is None
        mine.close()
        put(pedal, PEDAL, 0)
        event = other.read_one()
        assert event is not None
        assert (event.code, event.value) == (PEDAL, 0)
        other.close()
    finally:
        pedal.close()


def test_events_that_the_kernel_dropped_are_told_and_the_state_is_right() -> None:
    pedal = plugged_in()
    try:
        path = next(device.path for device in list_devices() if device.name == NAME)
        mine = open_input(path, {PEDAL}, True)
        for _ in range(500):
            put(pedal, PEDAL, 1)
            put(pedal, PEDAL, 0)
        put(pedal, PEDAL, 1)
        _, dropped = mine.read()
        assert dropped
        assert mine.down() == {PEDAL}
        mine.close()
    finally:
        pedal.close()


def test_two_pedals_of_one_name_are_refused_until_one_is_named_by_its_place() -> None:
    first, second = plugged_in(), plugged_in()

    async def story() -> None:
        reader = InputReader(NAME, {"KEY_B": None})
        reader.start()
        assert state(reader) is None
        assert "2 devices are named" in reader.keys["KEY_B"].words
        reader.close()

    try:
        asyncio.run(story())
    finally:
        first.close()
        second.close()
