"""An input device where the kernel has none: evdev reads its events from a pipe, as from a device file."""

from __future__ import annotations

import errno
import os
import struct
from typing import Any, cast

import evdev
import pytest

from common.inputs.device import EV_KEY, EV_SYN, SYN_DROPPED
from common.inputs.key_state import DOWN, UP

PEDAL, CLUTCH = evdev.ecodes.KEY_B, evdev.ecodes.KEY_C
READ = evdev.InputDevice.read
"""Before `Socket` takes its place."""


class PseudoDevice:
    """The far end of the pipe is the pedal. Only the ioctls are played; the events are read by evdev."""

    def __init__(self, keys: frozenset[int] = frozenset({PEDAL, CLUTCH})) -> None:
        self.path = "/dev/input/event7"
        self.keys = keys
        self.pressed: set[int] = set()
        self.grabbed_by_another = self.grabbed = self.gone = False
        self.fd, self._pedal = os.pipe()
        os.set_blocking(self.fd, False)

    def key(self, code: int, value: int) -> None:
        """A key goes down (1), up (0), or is repeated (2)."""
        (self.pressed.discard if value == UP else self.pressed.add)(code)
        self.send(EV_KEY, code, value)
        self.send(EV_SYN, 0, 0)

    def press(self, code: int = PEDAL) -> None:
        self.key(code, DOWN)

    def release(self, code: int = PEDAL) -> None:
        self.key(code, UP)

    def send(self, kind: int, code: int, value: int) -> None:
        os.write(self._pedal, struct.pack("llHHi", 0, 0, kind, code, value))

    def drop(self) -> None:
        self.send(EV_SYN, SYN_DROPPED, 0)

    def unplug(self) -> None:
        """Reading fails as it does on a device that has gone; the descriptor becomes readable."""
        self.gone = True
        self.send(EV_SYN, 0, 0)

    def read(self) -> Any:
        if self.gone:
            raise OSError(errno.ENODEV, os.strerror(errno.ENODEV))
        return READ(cast("evdev.InputDevice[str]", self))

    def active_keys(self, verbose: bool = False) -> Any:
        if self.gone:
            raise OSError(errno.ENODEV, os.strerror(errno.ENODEV))
        return sorted(self.pressed)

    def capabilities(self, verbose: bool = False, absinfo: bool = True) -> Any:
        return {EV_KEY: sorted(self.keys)}

    def grab(self) -> None:
        if self.grabbed_by_another:
            raise OSError(errno.EBUSY, os.strerror(errno.EBUSY))
        self.grabbed = True

    def close(self) -> None:
        for fd in (self.fd, self._pedal):
            if fd >= 0:
                os.close(fd)
        self.fd = self._pedal = -1


class Socket:
    """Where a pseudo-device is plugged in: what evdev opens from now on."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.device: PseudoDevice | None = None
        monkeypatch.setattr("evdev.InputDevice", self._open)

    def plug_in(self, device: PseudoDevice | None = None) -> PseudoDevice:
        self.device = device or PseudoDevice()
        return self.device

    def _open(self, path: str, readonly: bool = False) -> PseudoDevice:
        assert readonly
        if self.device is None or self.device.gone:
            raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), path)
        return self.device


@pytest.fixture
def socket(monkeypatch: pytest.MonkeyPatch) -> Socket:
    return Socket(monkeypatch)
