"""Keeps an input device open on the event loop, and knows which of its keys are down.

A device that is unplugged is looked for again twice a second; meanwhile its keys are unknown. The reader
has no thread: a process that stalls sends nothing at all, instead of what was true before.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Mapping
from contextlib import suppress

from common.clock import Clock, monotonic_ns
from common.inputs.device import InputError, Opener, OpenInput, key_code, open_input
from common.inputs.key_state import KeyState
from common.log.throttle import LogThrottle

log = logging.getLogger(__name__)

AGAIN_S = 0.5
"""Between two attempts to open a device that is not there."""


class InputReader:
    """One device, any number of its keys.

    Raises InputError for a key that no kernel has, ModuleNotFoundError without the extra `input`.
    """

    def __init__(
        self,
        device: str,
        keys: Mapping[str, float | None],
        *,
        grab: bool = True,
        opener: Opener = open_input,
        clock: Clock = monotonic_ns,
    ) -> None:
        """`keys`: the names of the keys to watch, each with its `repeat_timeout_s`."""
        self.device = device
        self.keys = {name: KeyState(name, timeout_s) for name, timeout_s in keys.items()}
        self.on_change: Callable[[], None] = lambda: None
        """Called after events, and when the device comes or goes."""
        self.times_lost = 0
        self._codes = {key_code(name): state for name, state in self.keys.items()}
        self._grab = grab
        self._opener = opener
        self._clock = clock
        self._open: OpenInput | None = None
        self._again: asyncio.TimerHandle | None = None
        self._throttle = LogThrottle()

    def start(self) -> None:
        """Open the device, or look for it until it is there. Needs a running event loop."""
        self._again = None
        try:
            opened = self._opener(self.device, self._codes.keys(), self._grab)
        except InputError as error:
            self._lose(str(error))
            return
        self._open = opened
        asyncio.get_running_loop().add_reader(opened.fileno(), self._ready)
        self._reread()
        if self._open is not None:
            log.info("input %s: %s is open", self.device, opened.path)
        self.on_change()

    def poll(self) -> None:
        """Take what has come by now, and compare it with what the device says itself. Before each use."""
        if self._open is None:
            return
        self._take(self._open)
        self._reread()

    def close(self) -> None:
        """Let go of the device. Safe to call twice."""
        if self._again is not None:
            self._again.cancel()
            self._again = None
        self._let_go()

    def _ready(self) -> None:
        if self._open is not None:
            self._take(self._open)
        self.on_change()

    def _take(self, opened: OpenInput) -> None:
        try:
            events, dropped = opened.read()
        except OSError as error:
            self._lose(f"{opened.path} has gone ({error.strerror})")
            return
        except Exception as error:  # whatever the library raises, a key must not stay down by it
            self._lose(f"{opened.path} cannot be read: {error!r}")
            return
        now_ns = self._clock()
        for code, value in events:
            if code in self._codes:
                self._codes[code].event(value, now_ns)
        if dropped:
            self._reread()

    def _reread(self) -> None:
        if self._open is None:
            return
        try:
            down = self._open.down()
        except OSError as error:
            self._lose(f"{self._open.path} has gone ({error.strerror})")
            return
        now_ns = self._clock()
        for code, state in self._codes.items():
            state.read(code in down, now_ns)

    def _lose(self, words: str) -> None:
        self.times_lost += self._open is not None
        self._let_go()
        for state in self.keys.values():
            state.lost(words)
        if self._throttle.passes(self._clock()):
            log.warning("input %s: %s", self.device, words)
        self._again = asyncio.get_running_loop().call_later(AGAIN_S, self.start)
        self.on_change()

    def _let_go(self) -> None:
        opened, self._open = self._open, None
        if opened is not None:
            asyncio.get_running_loop().remove_reader(opened.fileno())
            with suppress(OSError):
                opened.close()
