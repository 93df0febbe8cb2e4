"""An open input device, by the library evdev (extra `input`): its key events, and which keys are down."""

from __future__ import annotations

import errno
from collections.abc import Callable, Set
from typing import Protocol

from common.errors import TandemError
from common.inputs.listing import choose, list_devices


class InputError(TandemError):
    """An input device that cannot be read; the text says why and what to do."""


class OpenInput(Protocol):
    """What a reader needs of an open device. Each method raises OSError where the device has gone."""

    path: str

    def fileno(self) -> int:
        """The descriptor that becomes readable with the next event."""
        ...

    def read(self) -> tuple[list[tuple[int, int]], bool]:
        """Key events that have come, as code and value; and whether the kernel dropped some before them."""
        ...

    def down(self) -> set[int]:
        """Codes of the keys that are down, by the device itself (EVIOCGKEY)."""
        ...

    def close(self) -> None:
        """Let go of it."""
        ...


Opener = Callable[[str, Set[int], bool], OpenInput]
"""From a device's name or path, the codes of keys that it must have, and whether to grab it. InputError."""


def key_code(name: str) -> int:
    """The number of a key. Raises InputError for a name that the kernel does not have."""
    from evdev import ecodes

    code = ecodes.ecodes.get(name)
    if not isinstance(code, int):
        raise InputError(f"the kernel knows no key {name}: `tandem inputs` shows the name of the one pressed")
    return code


def key_name(code: int) -> str:
    """The kernel's name of a key; its number where it has none."""
    from evdev import ecodes

    names = ecodes.bytype[ecodes.EV_KEY].get(code, f"key {code}")
    return names if isinstance(names, str) else str(names[0])


def open_input(device: str, codes: Set[int], grab: bool) -> OpenInput:
    """Open the device of this name or path. Raises InputError."""
    path, why = (device, "") if device.startswith("/") else choose(list_devices(), device, codes)
    if not path:
        raise InputError(why)
    return EvdevInput(path, codes, grab)


class EvdevInput:
    """A device of the kernel."""

    def __init__(self, path: str, codes: Set[int], grab: bool) -> None:
        """Raises InputError."""
        import evdev

        self.path = path
        try:
            self._device = evdev.InputDevice(path, readonly=True)
        except PermissionError:
            raise InputError(f"{path}: this user may not read it: usermod -a -G input USER") from None
        except OSError as error:
            raise InputError(f"{path}: {error.strerror}") from None
        missing = codes - set(self._device.capabilities().get(EV_KEY, []))
        try:
            if missing:
                raise InputError(f"{path} has no {', '.join(key_name(code) for code in sorted(missing))}")
            if grab:
                self._device.grab()
        except InputError:
            self._device.close()
            raise
        except OSError as error:
            self._device.close()
            busy = "another program has grabbed it" if error.errno == errno.EBUSY else error.strerror
            raise InputError(f"{path}: {busy}") from None

    def fileno(self) -> int:
        """The descriptor that becomes readable with the next event."""
        return int(self._device.fd)

    def read(self) -> tuple[list[tuple[int, int]], bool]:
        """Key events that have come, and whether the kernel dropped some (SYN_DROPPED)."""
        events: list[tuple[int, int]] = []
        dropped = False
        while True:
            try:
                came = list(self._device.read())
            except BlockingIOError:
                return events, dropped
            if not came:
                return events, dropped
            for event in came:
                if event.type == EV_KEY:
                    events.append((event.code, event.value))
                elif event.type == EV_SYN and event.code == SYN_DROPPED:
                    events, dropped = [], True

    def down(self) -> set[int]:
        """Codes of the keys that are down. The kernel drops the key events not yet read: read them first."""
        return set(self._device.active_keys())

    def close(self) -> None:
        """Let go of it, and of the grab."""
        self._device.close()


EV_SYN, EV_KEY = 0, 1
SYN_DROPPED = 3
"""Of the kernel's input-event-codes.h, so that they are known before the library is imported."""
