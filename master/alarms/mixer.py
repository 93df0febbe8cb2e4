"""Blocks of samples for a sound card: the burst that sounds, the one that cuts it off, silence. Pure."""

from __future__ import annotations

import numpy as np

from common.quaternion import Array

_FADE_S = 0.005
"""In which a burst that is cut off fades out: an edge would click."""


class Mixer:
    """One burst at a time. One thread calls `play`, another `render`: each sets whole references."""

    def __init__(self, rate_hz: int, volume: float) -> None:
        self._fade = np.linspace(1.0, 0.0, max(2, round(_FADE_S * rate_hz)))
        self._volume = volume
        self._asked: Array | None = None
        self._wave: Array = np.zeros(0)
        self._at = 0

    def play(self, wave: Array) -> None:
        """Begin a burst with the next block; what sounds is faded out."""
        self._asked = wave

    def render(self, count: int) -> Array:
        """The next samples (count,)."""
        out = np.zeros(count)
        asked, self._asked = self._asked, None
        if asked is not None:
            rest = self._wave[self._at :][: len(self._fade)]
            self._wave = np.concatenate([rest * self._fade[: len(rest)], asked])
            self._at = 0
        part = self._wave[self._at : self._at + count]
        out[: len(part)] = self._volume * part
        self._at += len(part)
        return out
