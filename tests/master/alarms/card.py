"""A stand-in for `sounddevice` that does what sound cards do besides playing."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np

from common.quaternion import Array


class CardError(Exception):
    """As `sounddevice.PortAudioError`."""


@dataclass
class Stream:
    """One that was opened."""

    card: Card
    rate_hz: int
    callback: Callable[..., None]
    active: bool = False

    def start(self) -> None:
        if self.card.wont_start:
            raise CardError("Error starting stream: Unanticipated host error [PaErrorCode -9999]")
        self.active = True

    def abort(self) -> None:
        if not self.card.plugged:
            raise CardError("Error aborting stream: Device unavailable [PaErrorCode -9985]")
        self.active = False

    def close(self) -> None:
        self.card.stream = None


class Card:
    """The module and its one sound card."""

    PortAudioError = CardError

    def __init__(self, rates_hz: tuple[int, ...] = (44_100, 48_000)) -> None:
        self.OutputStream = self._open
        self.rates_hz = rates_hz
        self.plugged = True
        self.wont_start = False
        self.tells_when_gone = False
        """Most hosts go on calling such a stream active."""
        self.stream: Stream | None = None
        self.started = 1
        """Times that the library was started: its list of cards is as old."""
        self._listed = True
        self.opened: list[int] = []
        self.heard: list[Array] = []

    def _open(self, *, samplerate: int, channels: int, dtype: str, device: object, callback: Any) -> Stream:
        assert (channels, dtype) == (1, "float32")
        if not self._listed:
            raise ValueError(f"No output device matching {device!r}")
        if not self.plugged:
            raise CardError("Error opening OutputStream: Device unavailable [PaErrorCode -9985]")
        if samplerate not in self.rates_hz:
            raise CardError("Error opening OutputStream: Invalid sample rate [PaErrorCode -9997]")
        self.opened.append(samplerate)
        self.stream = Stream(self, samplerate, callback)
        return self.stream

    def query_devices(self, device: object, kind: str) -> dict[str, float]:
        assert kind == "output"
        if not self._listed:
            raise ValueError(f"No output device matching {device!r}")
        return {"default_samplerate": float(self.rates_hz[0])}

    def _terminate(self) -> None:
        self.stream = None

    def _initialize(self) -> None:
        self.started += 1
        self._listed = self.plugged

    def unplug(self) -> None:
        """It asks for no more samples; nobody says so."""
        self.plugged = False
        if self.stream is not None and self.tells_when_gone:
            self.stream.active = False

    def asks(self, frames: int = 480, *, late: bool = False) -> None:
        """The card wants its next block; `late`: it has run out meanwhile."""
        if self.stream is None or not self.plugged:
            return
        out = np.full((frames, 1), np.nan, np.float32)
        self.stream.callback(out, frames, None, SimpleNamespace(output_underflow=late))
        assert np.isfinite(out).all()
        self.heard.append(out[:, 0].astype(np.float64))
