"""`tandem inputs` with pedals that are not there."""

from __future__ import annotations

import asyncio
from collections.abc import Set
from pathlib import Path

import pytest

from common.clock import to_ns
from common.errors import TandemError
from common.inputs.device import InputError, OpenInput, open_input
from common.inputs.key_state import SHORT_S
from common.inputs.listing import ListedDevice
from deploy.ops.inputs import as_table, as_tree, lasting, watch
from tests.common.inputs.pseudo import CLUTCH, PEDAL, PseudoDevice, Socket, socket

__all__ = ["socket"]
PEDALS = ListedDevice("/dev/input/event7", "FootSwitch", "usb-1", frozenset({PEDAL, CLUTCH}), True, False)


class Shown:
    """The command, watching one pedal on a clock that is given."""

    def __init__(self, pedal: PseudoDevice) -> None:
        self.pedal = pedal
        self.said: list[str] = []
        self.now_ns = 0

    async def __aenter__(self) -> Shown:
        self._task = asyncio.ensure_future(
            watch([PEDALS], None, self.said.append, open_input, lambda: self.now_ns)
        )
        await asyncio.sleep(0)
        return self

    async def __aexit__(self, *_: object) -> None:
        self._task.cancel()
        await asyncio.gather(self._task, return_exceptions=True)

    async def until(self, words: str) -> None:
        while not any(words in line for line in self.said):  # noqa: ASYNC110 (nothing else tells it)
            await asyncio.sleep(0)


def test_what_is_pressed_is_shown_as_it_is_to_be_written(socket: Socket) -> None:
    pedal = socket.plug_in()
    pedal.pressed.add(CLUTCH)

    async def story() -> None:
        async with Shown(pedal) as shown:
            await shown.until("KEY_C is down already")
            pedal.press()
            await shown.until('device = "FootSwitch", key = "KEY_B"')
            shown.now_ns = to_ns(SHORT_S)
            pedal.release()
            await shown.until("up    FootSwitch: KEY_B")
            assert not any("at once" in line for line in shown.said)
            assert not pedal.grabbed
            pedal.unplug()
            await shown.until("has gone")

    asyncio.run(story())


def test_a_pedal_that_cannot_be_held_is_told(socket: Socket) -> None:
    pedal = socket.plug_in()

    async def story() -> None:
        async with Shown(pedal) as shown:
            pedal.press()
            pedal.release()
            await shown.until("press and release came at once")

    asyncio.run(story())


def test_devices_that_may_not_be_read_are_named() -> None:
    def denied(path: str, codes: Set[int], grab: bool) -> OpenInput:
        raise InputError(f"{path}: this user may not read it")

    said: list[str] = []
    with pytest.raises(TandemError, match="usermod"):
        asyncio.run(watch([PEDALS], None, said.append, denied))
    assert said == ["/dev/input/event7: this user may not read it"]


def test_as_plain_values_with_the_keys_that_are_down(socket: Socket, tmp_path: Path) -> None:
    socket.plug_in().pressed.add(PEDAL)
    (tmp_path / "dev/input/by-id").mkdir(parents=True)
    (tmp_path / "dev/input/event7").touch()
    (tmp_path / "dev/input/by-id/usb-foot").symlink_to("../event7")
    assert as_tree(PEDALS, tmp_path) == {
        "path": "/dev/input/event7",
        "lasting": ["/dev/input/by-id/usb-foot"],
        "name": "FootSwitch",
        "place": "usb-1",
        "keys": 2,
        "readable": True,
        "repeats": False,
        "down": ["KEY_B"],
    }
    assert lasting("/dev/input/event8", tmp_path) == []


def test_the_table_leaves_out_what_has_no_keys() -> None:
    no_keys = ListedDevice("/dev/input/event8", "Lid", "", frozenset(), True, False)
    assert as_table([PEDALS, no_keys]).row_count == 1
