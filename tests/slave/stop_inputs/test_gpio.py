"""A line as the kernel's chips have them: renumbered, of one name, busy, vanished, without edges, slow."""

from __future__ import annotations

import errno
from pathlib import Path

import gpiod
import pytest
from gpiod.line import Bias, Edge, Value

from slave.stop_inputs import gpio
from slave.stop_inputs.config import StopInputConfig
from slave.stop_inputs.gpio import GpioStop, read_chips
from slave.stop_inputs.gpio_lines import GpioChip, find_line

CONFIG = StopInputConfig(name="red button", source="gpio", line="STOP")
SOC = GpioChip("/dev/gpiochip0", "pinctrl-bcm2711", ("ID_SDA", "", "STOP"))
USB = GpioChip("/dev/gpiochip3", "cp2112_gpio", ("", "STOP"))


def test_a_line_is_found_by_its_name_on_whichever_chip_it_is_today() -> None:
    assert find_line([SOC], "STOP", "") == ("/dev/gpiochip0", 2)
    assert find_line([GpioChip("/dev/gpiochip5", SOC.label, SOC.lines)], "STOP", "") == ("/dev/gpiochip5", 2)


def test_a_number_counts_on_the_chip_that_is_named() -> None:
    assert find_line([SOC, USB], "1", "cp2112_gpio") == ("/dev/gpiochip3", 1)
    assert find_line([SOC, USB], "STOP", "/dev/gpiochip3") == ("/dev/gpiochip3", 1)


@pytest.mark.parametrize(
    ("chips", "line", "chip", "unreadable", "said"),
    [
        ([SOC, USB], "STOP", "", (), "2 lines are meant: line 2 of /dev/gpiochip0, line 1 of /dev/gpiochip3"),
        ([SOC], "STEP", "", (), "no line STEP is there"),
        ([SOC], "9", "pinctrl-bcm2711", (), "no line 9 is there"),
        (
            [SOC],
            "STOP",
            "tca9555",
            (),
            "no GPIO chip tca9555 is there; this host has pinctrl-bcm2711 (/dev/gpiochip0)",
        ),
        ([], "STOP", "", (), "this host has none"),
        ([], "STOP", "", ("/dev/gpiochip0",), "this user may not read /dev/gpiochip0"),
    ],
)
def test_what_is_wrong_is_said(
    chips: list[GpioChip], line: str, chip: str, unreadable: tuple[str, ...], said: str
) -> None:
    with pytest.raises(LookupError) as error:
        find_line(chips, line, chip, unreadable)
    assert said in str(error.value)


class PseudoLine:
    """A line that a test presses."""

    def __init__(self) -> None:
        self.high = False
        self.edges = 0
        self.gone = False
        self.closed = 0

    def wait(self, timeout_s: float) -> bool:
        edges, self.edges = self.edges, 0
        return bool(edges)

    def read(self) -> bool:
        if self.gone:
            raise OSError(errno.ENODEV, "No such device")
        return self.high

    def close(self) -> None:
        self.closed += 1


class Stop(GpioStop):
    """On a clock that a test sets; `turn` is what the thread does over and over."""

    def __init__(self) -> None:
        self.now_ns = 1000
        self.line = PseudoLine()
        self.refused: OSError | LookupError | None = None
        super().__init__(CONFIG, lambda: self.now_ns, self._give)

    def _give(self, _: StopInputConfig) -> PseudoLine:
        if self.refused is not None:
            raise self.refused
        return self.line

    def after(self, dt_ns: int) -> bool:
        self.now_ns += dt_ns
        return self.turn(0.0)


def test_nothing_is_known_before_the_first_reading() -> None:
    assert Stop().read().on is None


def test_the_level_is_read_over_and_over_without_any_edge() -> None:
    stop = Stop()
    assert stop.after(1)
    assert (stop.read().on, stop.read().read_ns, stop.read().changed_ns) == (False, 1001, 0)
    stop.line.high = True  # an edge that the kernel's buffer lost
    stop.after(10)
    assert (stop.read().on, stop.read().changed_ns) == (True, 1011)
    stop.after(10)
    assert (stop.read().read_ns, stop.read().changed_ns) == (1021, 1011)


def test_a_press_between_two_readings_is_told_by_its_edges() -> None:
    stop = Stop()
    stop.after(1)
    stop.line.edges = 2
    stop.after(10)
    assert (stop.read().on, stop.read().changed_ns) == (False, 1011)


def test_a_line_that_vanishes_is_not_known_and_is_opened_again() -> None:
    stop = Stop()
    stop.after(1)
    stop.line.gone = True
    assert not stop.after(1)
    assert (stop.read().on, stop.read().why) == (None, "No such device")
    assert stop.line.closed == 1
    stop.line = PseudoLine()
    assert stop.after(1)
    assert stop.read().on is False


def test_a_line_that_cannot_be_opened_says_why() -> None:
    stop = Stop()
    stop.refused = LookupError("line 2 of /dev/gpiochip0 is used by gpiomon")
    assert not stop.after(1)
    assert stop.read().why == "line 2 of /dev/gpiochip0 is used by gpiomon"


def test_the_thread_reads_on_until_it_is_stopped() -> None:
    stop = Stop()
    stop.start()
    stop.line.high = True
    stop.now_ns = 2000
    for _ in range(2000):
        if stop.read().on:
            break
        stop._ending.wait(0.005)
    assert stop.read().on
    stop.stop()
    stop.stop()
    assert stop.line.closed == 1


def test_files_that_are_no_chips_and_old_names_of_chips_are_left_out(tmp_path: Path) -> None:
    (tmp_path / "gpiochip0").write_text("")
    (tmp_path / "gpiochip4").symlink_to("gpiochip0")
    assert read_chips(tmp_path) == ([], [])


class FakeRequest:
    def __init__(self) -> None:
        self.released = False

    def get_value(self, _: int) -> Value:
        return Value.ACTIVE

    def release(self) -> None:
        self.released = True


def test_a_chip_without_interrupts_is_read_by_its_level_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []

    def ask(path: str, config: dict[int, gpiod.LineSettings], consumer: str) -> FakeRequest:
        (settings,) = config.values()
        asked.append((settings.edge_detection, settings.bias, settings.active_low))
        if settings.edge_detection is not Edge.NONE:
            raise OSError(errno.ENXIO, "No such device or address")
        return FakeRequest()

    monkeypatch.setattr(gpio, "read_chips", lambda: ([SOC], []))
    monkeypatch.setattr(gpiod, "request_lines", ask)
    line = gpio.KernelLine(CONFIG)
    assert asked == [(Edge.BOTH, Bias.PULL_UP, False), (Edge.NONE, Bias.PULL_UP, False)]
    assert not line.wait(0.0)
    assert line.read()
