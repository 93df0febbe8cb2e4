"""What the operator's pedals tell now, without grabbing them."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass

from common.inputs.config import KeyConfig
from common.inputs.device import InputError, key_code, open_input
from common.inputs.listing import ListedDevice, choose, list_devices


@dataclass(frozen=True, slots=True)
class PedalRead:
    """One key of one device."""

    path: str
    """Empty where it is not there, or not one of several."""
    why: str
    """Why it cannot be read; empty where it can."""
    down: bool | None = None


def read_pedal(key: KeyConfig, devices: Callable[[], Sequence[ListedDevice]] = list_devices) -> PedalRead:
    """Open the device of a key for a moment, and read whether the key is down."""
    if importlib.util.find_spec("evdev") is None:
        return PedalRead("", "the package that reads it is missing: pip install 'tandem[input]'")
    try:
        code = key_code(key.key)
        path, why = (key.device, "") if key.device.startswith("/") else choose(devices(), key.device, {code})
        if not path:
            return PedalRead("", why)
        opened = open_input(path, {code}, False)
    except InputError as error:
        return PedalRead("", str(error))
    with suppress(OSError):
        down = code in opened.down()
        opened.close()
        return PedalRead(path, "", down)
    return PedalRead(path, f"{path} has gone")
