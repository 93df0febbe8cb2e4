"""A device is kept open, read, lost and found again."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable, Coroutine
from contextlib import asynccontextmanager
from typing import Any

import pytest

from common.inputs import reader as reader_module
from common.inputs.device import InputError
from common.inputs.key_state import REPEATED
from common.inputs.reader import InputReader
from tests.common.inputs.pseudo import CLUTCH, PEDAL, PseudoDevice, Socket, socket

__all__ = ["socket"]
PATH = "/dev/input/by-id/pedal"
Keys = dict[str, bool | None]


def keys(reader: InputReader) -> Keys:
    return {name: key.at(0) for name, key in reader.keys.items()}


@asynccontextmanager
async def reading(device: str = PATH, grab: bool = True) -> AsyncIterator[InputReader]:
    reader = InputReader(device, {"KEY_B": None, "KEY_C": None}, grab=grab, clock=lambda: 0)
    reader.start()
    try:
        yield reader
    finally:
        reader.close()


def played(story: Callable[[], Coroutine[Any, Any, None]]) -> None:
    asyncio.run(story())


async def until(condition: Callable[[], bool]) -> None:
    """Turns of the loop; the test's own time limit ends one that never comes true."""
    while not condition():  # noqa: ASYNC110 (what is waited for is not an event of the loop's own)
        await asyncio.sleep(0)


def test_events_arrive_on_the_event_loop_and_each_key_is_told_apart(socket: Socket) -> None:
    pedal = socket.plug_in()

    async def story() -> None:
        async with reading() as reader:
            assert keys(reader) == {"KEY_B": False, "KEY_C": False}
            pedal.press()
            await until(lambda: keys(reader) == {"KEY_B": True, "KEY_C": False})
            pedal.press(CLUTCH)
            pedal.key(PEDAL, REPEATED)
            pedal.key(999, 1)
            await until(lambda: keys(reader) == {"KEY_B": True, "KEY_C": True})
            pedal.release()
            await until(lambda: keys(reader) == {"KEY_B": False, "KEY_C": True})

    played(story)


def test_what_has_come_is_taken_before_the_loop_gets_to_it(socket: Socket) -> None:
    pedal = socket.plug_in()

    async def story() -> None:
        async with reading() as reader:
            pedal.press()
            reader.poll()
            assert keys(reader)["KEY_B"] is True
            pedal.release()
            pedal.press()
            reader.poll()
            assert (keys(reader)["KEY_B"], reader.keys["KEY_B"].releases) == (True, 1)

    played(story)


def test_the_state_at_opening_is_the_devices_own(socket: Socket) -> None:
    socket.plug_in().pressed.add(PEDAL)

    async def story() -> None:
        async with reading() as reader:
            assert keys(reader) == {"KEY_B": True, "KEY_C": False}

    played(story)


def test_after_lost_events_the_state_is_read_again(socket: Socket) -> None:
    pedal = socket.plug_in()

    async def story() -> None:
        async with reading() as reader:
            pedal.press()
            await until(lambda: keys(reader)["KEY_B"] is True)
            pedal.pressed.clear()  # the release was among what the kernel dropped
            pedal.key(CLUTCH, 0)
            pedal.drop()
            await until(lambda: keys(reader)["KEY_B"] is False)

    played(story)


def test_a_release_whose_event_never_came_is_seen_at_the_next_look(socket: Socket) -> None:
    pedal = socket.plug_in()

    async def story() -> None:
        async with reading() as reader:
            pedal.press()
            reader.poll()
            pedal.pressed.clear()
            reader.poll()
            assert keys(reader)["KEY_B"] is False

    played(story)


def test_a_device_that_is_unplugged_is_unknown_at_once_and_opened_again(
    socket: Socket, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(reader_module, "AGAIN_S", 0.0)
    pedal = socket.plug_in()

    async def story() -> None:
        async with reading() as reader:
            changes: list[Keys] = []
            reader.on_change = lambda: changes.append(keys(reader))
            pedal.press()
            pedal.unplug()
            await until(lambda: bool(changes))
            assert changes[0] == {"KEY_B": None, "KEY_C": None}
            assert "has gone (No such device)" in reader.keys["KEY_B"].words
            await until(lambda: "No such file" in reader.keys["KEY_B"].words)
            again = socket.plug_in()
            again.pressed.add(PEDAL)
            await until(lambda: keys(reader)["KEY_B"] is True)
            assert reader.times_lost == 1
            again.release()
            await until(lambda: keys(reader)["KEY_B"] is False)

    played(story)


def test_an_unforeseen_error_of_the_library_makes_the_keys_unknown(
    socket: Socket, monkeypatch: pytest.MonkeyPatch
) -> None:
    pedal = socket.plug_in()

    async def story() -> None:
        async with reading() as reader:
            pedal.press()
            reader.poll()
            monkeypatch.delattr(PseudoDevice, "read")
            pedal.release()
            await until(lambda: keys(reader)["KEY_B"] is None)
            assert "cannot be read" in reader.keys["KEY_B"].words

    played(story)


def test_a_device_that_goes_between_two_events_is_noticed_by_a_look(socket: Socket) -> None:
    pedal = socket.plug_in()

    async def story() -> None:
        async with reading() as reader:
            pedal.press()
            reader.poll()
            pedal.gone = True
            reader.poll()
            assert keys(reader) == {"KEY_B": None, "KEY_C": None}

    played(story)


def test_the_device_is_grabbed_unless_it_is_to_be_shared(socket: Socket) -> None:
    async def story(grab: bool) -> None:
        pedal = socket.plug_in()
        async with reading(grab=grab):
            assert pedal.grabbed == grab

    asyncio.run(story(True))
    asyncio.run(story(False))


def test_a_device_that_another_program_grabbed_is_unknown(socket: Socket) -> None:
    socket.plug_in().grabbed_by_another = True

    async def story() -> None:
        async with reading() as reader:
            assert keys(reader)["KEY_B"] is None
            assert "another program has grabbed it" in reader.keys["KEY_B"].words

    played(story)


def test_a_device_without_the_key_is_refused_in_words(socket: Socket) -> None:
    socket.plug_in(PseudoDevice(keys=frozenset({PEDAL})))

    async def story() -> None:
        async with reading() as reader:
            assert keys(reader) == {"KEY_B": None, "KEY_C": None}
            assert "has no KEY_C" in reader.keys["KEY_B"].words

    played(story)


def test_a_name_that_no_device_has_is_waited_for() -> None:
    async def story() -> None:
        async with reading("no such pedal") as reader:
            assert "no input device is named 'no such pedal'" in reader.keys["KEY_B"].words

    played(story)


def test_a_key_that_the_kernel_does_not_know_is_refused() -> None:
    with pytest.raises(InputError, match="knows no key KEY_NOWHERE"):
        InputReader(PATH, {"KEY_NOWHERE": None})
