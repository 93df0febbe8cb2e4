"""What a TOML says of a key: of a foot pedal, a button or a gamepad, each of which Linux calls a keyboard."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from common.config.section import Section

KeyName = Annotated[str, Field(pattern=r"^(KEY|BTN)_[A-Z0-9_]+$")]
"""A key by the kernel's name for it, such as `KEY_B` or `BTN_TRIGGER`; `tandem inputs` shows it."""


class KeyConfig(Section):
    """One key of one Linux input device."""

    device: str = Field(min_length=1, max_length=256)
    """The device's name, or a path that begins with `/`: one below /dev/input/by-id or by-path lasts."""
    key: KeyName
    grab: bool = True
    """True: no other program receives the device's keys, so that no letter is typed into a terminal."""
    repeat_timeout_s: float | None = Field(None, ge=0.05, le=5.0)
    """Only for a device that itself repeats a held key: without a repeat for so long the key counts as
    released. None: most pedals do not repeat, and a repeat by the kernel shows nothing about the device. The
    kernel repeats only the key that was pressed last: with two keys of one device held this is not usable."""
