"""A stop button at a real gpiochip of the kernel's: that of a USB chip which a test plays."""

from __future__ import annotations

import os
import shutil
import subprocess
import time
from collections.abc import Callable, Iterator

import pytest

from common.clock import monotonic_ns
from slave.stop_inputs.config import EstopConfig, StopInputConfig
from slave.stop_inputs.gpio import GpioStop, read_chips
from slave.stop_inputs.rule import StopInputs
from tests.slave.stop_inputs.cp2112 import LABEL, UHID, PlayedChip

pytestmark = pytest.mark.live
CONFIG = StopInputConfig(
    name="red button", source="gpio", line="3", chip=LABEL, bias="pull_down", edges=False
)
LINE = 1 << 3
LIMIT_S = 30.0


def until(condition: Callable[[], bool]) -> float:
    """Seconds that it took."""
    began_s = time.monotonic()
    while not condition():
        assert time.monotonic() < began_s + LIMIT_S
        time.sleep(0.001)
    return time.monotonic() - began_s


def chip_is_there() -> bool:
    return any(chip.label == LABEL for chip in read_chips()[0])


@pytest.fixture
def chip() -> Iterator[PlayedChip]:
    for module in ("uhid", "hid-cp2112"):  # built in, loaded or to be loaded
        if shutil.which("modprobe"):
            subprocess.run(["modprobe", "-q", module], check=False, stderr=subprocess.DEVNULL)
    if not os.access(UHID, os.W_OK):
        pytest.skip("this kernel has no uhid with the driver of the CP2112")
    chip = PlayedChip()
    try:
        try:
            until(chip_is_there)
        except AssertionError:
            pytest.skip("this kernel has no uhid with the driver of the CP2112")
        yield chip
    finally:
        if chip._thread.is_alive():
            chip.unplug()


@pytest.fixture
def stop(chip: PlayedChip) -> Iterator[GpioStop]:
    stop = GpioStop(CONFIG)
    stop.start()
    yield stop
    stop.stop()


def test_an_opened_contact_is_read_and_a_closed_one_again(chip: PlayedChip, stop: GpioStop) -> None:
    assert stop.read().on
    chip.levels &= ~LINE
    until(lambda: stop.read().on is False)
    assert stop.read().changed_ns
    chip.levels |= LINE
    until(lambda: bool(stop.read().on))


def test_a_slow_chip_delays_the_thread_and_never_the_loop(chip: PlayedChip, stop: GpioStop) -> None:
    chip.answers_after_s = 0.05
    until(lambda: monotonic_ns() - stop.read().read_ns > 20_000_000)
    longest_s = max(until(lambda: stop.read().on is not None) for _ in range(50))
    assert longest_s < 0.04
    chip.levels &= ~LINE
    until(lambda: stop.read().on is False)


def test_a_chip_that_hangs_is_silent_and_one_that_is_unplugged_comes_back(
    chip: PlayedChip, stop: GpioStop
) -> None:
    inputs = StopInputs(EstopConfig(inputs=[CONFIG]))

    def words() -> str:
        return inputs.step(monotonic_ns(), [stop.read()]).get(CONFIG.name, "")

    until(lambda: not words())
    chip.answers_after_s = 1.0
    until(lambda: "not heard for" in words())
    chip.answers_after_s = 0.0
    until(lambda: not words())
    chip.unplug()
    until(lambda: stop.read().on is None)
    assert words()
    again = PlayedChip()
    until(lambda: not words())
    again.unplug()


def test_a_line_that_another_program_holds_says_which(chip: PlayedChip, stop: GpioStop) -> None:
    other = GpioStop(CONFIG)
    other.turn(0.0)
    assert "is used by tandem e-stop" in other.read().why
