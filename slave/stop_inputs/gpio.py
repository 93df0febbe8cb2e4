"""A GPIO line as an emergency stop input, by the library gpiod (extra `gpio`): a thread that reads its level.

A chip behind USB or I²C takes milliseconds to answer, which the servo loop cannot wait for. Edges wake the
thread at once. Besides, it reads the level every tick: edges are lost where nobody takes them in time, and
some chips tell none.
"""

from __future__ import annotations

import errno
import logging
import threading
from collections.abc import Callable
from contextlib import suppress
from datetime import timedelta
from pathlib import Path
from typing import Protocol

import gpiod
from gpiod.line import Bias, Direction, Edge, Value

from common.clock import Clock, monotonic_ns
from common.log.throttle import LogThrottle
from slave.stop_inputs.config import StopInputConfig
from slave.stop_inputs.gpio_lines import CONSUMER, GpioChip, find_line
from slave.stop_inputs.source import Level

log = logging.getLogger(__name__)

PERIOD_S = 0.004
"""Between two readings of the level; the servo loop's own period is 5 ms."""
_AGAIN_S = 1.0
"""Between two attempts to open a line."""
_JOIN_S = 2.0
_BIAS = {"pull_up": Bias.PULL_UP, "pull_down": Bias.PULL_DOWN, "external": Bias.AS_IS}


class OpenLine(Protocol):
    """An open line. Each method raises OSError where the line has gone."""

    def wait(self, timeout_s: float) -> bool:
        """Wait for an edge; whether one, or several, came."""
        ...

    def read(self) -> bool:
        """Whether it is high."""
        ...

    def close(self) -> None:
        """Let go of it."""
        ...


def read_chips(folder: Path = Path("/dev")) -> tuple[list[GpioChip], list[str]]:
    """Chips, and paths of those that this user may not open."""
    chips, unreadable = [], []
    for path in sorted(folder.glob("gpiochip*")):
        if path.is_symlink():  # the old name of a chip that has another one
            continue
        try:
            with gpiod.Chip(str(path)) as chip:
                info = chip.get_info()
                names = tuple(chip.get_line_info(number).name or "" for number in range(info.num_lines))
                chips.append(GpioChip(str(path), info.label, names))
        except PermissionError:
            unreadable.append(str(path))
        except OSError:  # unplugged meanwhile
            continue
    return chips, unreadable


class KernelLine:
    """A line of a chip of the kernel's, as an input. Raises OSError or LookupError where it cannot be had."""

    def __init__(self, config: StopInputConfig) -> None:
        chips, unreadable = read_chips()
        wanted = str(Path(config.chip).resolve()) if config.chip.startswith("/") else config.chip
        path, self._number = find_line(chips, config.line, wanted, unreadable)
        bias = _BIAS[config.bias]
        self._edges = config.edges
        try:
            self._request = self._ask(path, bias, Edge.BOTH if config.edges else Edge.NONE)
        except PermissionError:
            raise
        except OSError as error:
            if error.errno == errno.EBUSY:
                with gpiod.Chip(path) as chip:
                    user = chip.get_line_info(self._number).consumer
                raise LookupError(
                    f"line {self._number} of {path} is used by {user or 'the kernel'}"
                ) from None
            # a chip without interrupts: its level alone is read
            self._request = self._ask(path, bias, Edge.NONE)
            self._edges = False
        self._pause = threading.Event()

    def _ask(self, path: str, bias: Bias, edge: Edge) -> gpiod.LineRequest:
        settings = gpiod.LineSettings(direction=Direction.INPUT, bias=bias, edge_detection=edge)
        return gpiod.request_lines(path, {self._number: settings}, consumer=CONSUMER)

    def wait(self, timeout_s: float) -> bool:
        """Wait for an edge, or, where the chip tells none, for so long."""
        if not self._edges:
            self._pause.wait(timeout_s)
            return False
        came = self._request.wait_edge_events(timedelta(seconds=timeout_s))
        return came and bool(self._request.read_edge_events())

    def read(self) -> bool:
        """The voltage: no flag of a device tree turns it round."""
        return self._request.get_value(self._number) is Value.ACTIVE

    def close(self) -> None:
        """Let go of it."""
        self._request.release()


class GpioStop:
    """A `StopSource` that reads one line."""

    def __init__(
        self,
        config: StopInputConfig,
        clock: Clock = monotonic_ns,
        opener: Callable[[StopInputConfig], OpenLine] = KernelLine,
    ) -> None:
        self._config = config
        self._clock = clock
        self._opener = opener
        self._level = Level(clock(), None)
        self._line: OpenLine | None = None
        self._throttle = LogThrottle()
        self._ending = threading.Event()
        self._thread: threading.Thread | None = None

    def start(self) -> None:
        """Open the line and read it once; then read on in a thread."""
        self._ending.clear()
        self.turn(wait_s=0.0)
        self._thread = threading.Thread(target=self._run, name="stop input", daemon=True)
        self._thread.start()

    def read(self) -> Level:
        """The newest reading."""
        return self._level

    def stop(self) -> None:
        """End the thread and let go of the line."""
        self._ending.set()
        if self._thread is not None:
            self._thread.join(_JOIN_S)
            self._thread = None
        self._close()

    def turn(self, wait_s: float = PERIOD_S) -> bool:
        """Open the line where it is not, or wait for an edge, and read it. False: it cannot be read now."""
        try:
            if self._line is None:
                self._line = self._opener(self._config)
                log.info("emergency stop input %s: %s is open", self._config.name, self._config.where)
            edge = self._line.wait(wait_s)
            on = self._line.read()
        except (OSError, LookupError) as error:
            self._lose(error)
            return False
        now_ns, before = self._clock(), self._level
        flipped = edge or before.on is (not on)
        self._level = Level(now_ns, on, changed_ns=now_ns if flipped else before.changed_ns)
        return True

    def _lose(self, error: OSError | LookupError) -> None:
        now_ns = self._clock()
        words = error.strerror if isinstance(error, OSError) and error.strerror else str(error.args[0])
        self._close()
        self._level = Level(now_ns, None, words, now_ns)
        if self._throttle.passes(now_ns):
            log.error("emergency stop input %s: %s", self._config.name, words)

    def _close(self) -> None:
        line, self._line = self._line, None
        if line is not None:
            with suppress(OSError):
                line.close()

    def _run(self) -> None:
        while not self._ending.is_set():
            if not self.turn():
                self._ending.wait(_AGAIN_S)
