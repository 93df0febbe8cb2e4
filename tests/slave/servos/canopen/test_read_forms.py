"""The forms in which CiA 301 lets a drive answer a read, aborts in words, and answers that come late."""

from __future__ import annotations

import pytest

from common.clock import NS_PER_MS
from deploy.sim.drives.traits import ReadForm
from slave.servos.canopen.sdo import ABORTS, Exchange, More, Read, SdoAnswer, Write, answer
from tests.slave.servos.canopen.conftest import Wired

TYPE = Read(0x1000, 0, 0xFFFF, 402, "a CiA 402 drive")
HEAD = b"\x00\x10\x00"


@pytest.mark.parametrize(
    ("command", "size"), [(0x4F, 1), (0x4B, 2), (0x47, 3), (0x43, 4), (0x42, 4)], ids=lambda v: f"{v:02X}"
)
def test_expedited_answers_of_every_size(command: int, size: int) -> None:
    value = 0x81828384 & (1 << 8 * size) - 1
    # the bytes beyond the size are reserved: whatever they hold counts for nothing
    told = value.to_bytes(size, "little").ljust(4, b"\xa5")
    read = Read(0x1000, 0, 0xFFFF_FFFF, value, "the value")
    said = answer(read, bytes([command]) + HEAD + told)
    assert said == SdoAnswer(True, data=told[:size])


@pytest.mark.parametrize("told", [True, False])
@pytest.mark.parametrize("length", [1, 2, 4, 7, 8, 14, 15, 100])
def test_segmented_answers_of_any_length(told: bool, length: int) -> None:
    held = bytes(range(1, length + 1))
    exchange = Exchange(Read(0x1008, 0, 0xFF, 1, "begins with 1"))
    first = bytes([0x41 if told else 0x40, 0x08, 0x10, 0]) + (length if told else 0).to_bytes(4, "little")
    said, toggle = exchange.on_answer(first), 0
    while isinstance(said, More):
        assert said.request == bytes([0x60 | toggle]) + bytes(7)
        part, held = held[:7], held[7:]
        head = toggle | (7 - len(part)) << 1 | (not held)
        said = exchange.on_answer(bytes([head]) + part.ljust(7, b"\xa5"))
        toggle ^= 0x10
    assert said == SdoAnswer(True, data=bytes(range(1, length + 1)))


def test_a_segment_out_of_turn_and_a_wrong_length_are_told() -> None:
    exchange = Exchange(TYPE)
    assert isinstance(exchange.on_answer(b"\x41" + HEAD + b"\x02\0\0\0"), More)
    said = exchange.on_answer(b"\x1b\x92\x01" + bytes(5))
    assert said == SdoAnswer(False, "object 1000:0: toggle bit not alternated")
    exchange.on_answer(b"\x41" + HEAD + b"\x04\0\0\0")
    said = exchange.on_answer(b"\x0b\x92\x01" + bytes(5))
    assert said == SdoAnswer(False, "object 1000:0: 2 bytes received, 4 announced")


def test_an_endless_answer_ends() -> None:
    exchange, toggle = Exchange(TYPE), 0
    said = exchange.on_answer(b"\x40" + HEAD + bytes(4))
    for _ in range(1000):
        if not isinstance(said, More):
            break
        said = exchange.on_answer(bytes([toggle]) + bytes(7))
        toggle ^= 0x10
    assert said == SdoAnswer(False, "object 1000:0: longer than 4096 bytes")


@pytest.mark.parametrize("code", [*ABORTS, 0x1234_5678])
@pytest.mark.parametrize("transfer", [TYPE, Write(0x1000, 0, 4, 1)])
def test_aborts_in_words_in_the_midst_of_segments_too(code: int, transfer: Read | Write) -> None:
    exchange = Exchange(transfer)
    if isinstance(transfer, Read):
        exchange.on_answer(b"\x40" + HEAD + bytes(4))
    said = exchange.on_answer(b"\x80" + HEAD + code.to_bytes(4, "little"))
    assert said == SdoAnswer(False, f"object 1000:0: {ABORTS.get(code, 'aborted with 0x12345678')}")


@pytest.mark.parametrize("form", list(ReadForm))
def test_drives_that_answer_in_any_form_start(wired: Wired, form: ReadForm) -> None:
    for drive in wired.peer.drives:
        drive.traits.read_form = form
    wired.up()
    assert dict(wired.drives.faults) == {}


@pytest.mark.parametrize("late_ms", [100, 280, 400])
def test_drives_that_answer_late_start(wired: Wired, late_ms: int) -> None:
    wired.peer.drives[3].traits.answers_after_ns = late_ms * NS_PER_MS
    wired.start()
    wired.until(lambda: wired.drives.running, 20.0)
    assert dict(wired.drives.faults) == {}


def test_an_answer_that_is_none_is_not_called_silence(wired: Wired) -> None:
    bus, node = wired.where("neck_yaw")
    wired.cut.add(bus)
    wired.drives.start(wired.now_ns)
    wired.drives.on_frame(bus, 0x580 + node, b"\x60" + HEAD + bytes(4), wired.now_ns)
    wired.drives.pending(wired.now_ns + 301 * NS_PER_MS)
    said = wired.drives.not_running["neck_yaw"]
    assert said.endswith("object 1000:0 is answered with command 60h, which is no answer to it")
