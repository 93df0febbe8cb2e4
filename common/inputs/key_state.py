"""Whether a key is down, by the events of its device. Pure: every time is this host's clock, and is given."""

from __future__ import annotations

from common.clock import to_ns

UP, DOWN, REPEATED = 0, 1, 2
"""The value of a key's event."""


class KeyState:
    """One key. `down` is None while nobody can know."""

    def __init__(self, name: str, repeat_timeout_s: float | None = None) -> None:
        self.name = name
        self.down: bool | None = None
        self.words = "its device has not been opened yet"
        """Why `down` is None; empty where it is known."""
        self.presses = self.releases = 0
        """How often it went down and up: a release between two looks is seen, though it is down again."""
        self.short_presses = 0
        """Presses that were over within `SHORT_S`: a pedal that sends press and release at once."""
        self._repeat_timeout_ns = None if repeat_timeout_s is None else to_ns(repeat_timeout_s)
        self._heard_ns = self._pressed_ns = 0
        self._expired = False

    def event(self, value: int, now_ns: int) -> None:
        """Take one event of this key."""
        if value == REPEATED:  # is no press: a key whose repeats stopped stays up until it is pressed again
            self._heard_ns = now_ns
            return
        if value == DOWN:
            self._heard_ns, self._expired = now_ns, False
        self._set(value != UP, now_ns)

    def read(self, down: bool, now_ns: int) -> None:
        """Take what the device itself says: at opening, after lost events, and before each use."""
        if not down:
            self._expired = False
        self._set(down, now_ns)

    def lost(self, words: str) -> None:
        """The device is not there, or not this process's to read."""
        self.releases += bool(self.down)
        self.down, self.words, self._expired = None, words, False

    def at(self, now_ns: int) -> bool | None:
        """Whether the key is down now. A device that is to repeat and does not has released it."""
        timeout_ns = self._repeat_timeout_ns
        if self.down and timeout_ns is not None and abs(now_ns - self._heard_ns) > timeout_ns:
            self._expired = True
        return False if self.down and self._expired else self.down

    def _set(self, down: bool, now_ns: int) -> None:
        if down and not self.down:
            self._heard_ns = self._pressed_ns = now_ns
            self.presses += 1
        elif self.down and not down:
            self.releases += 1
            self.short_presses += now_ns - self._pressed_ns < to_ns(SHORT_S)
        self.down, self.words = down, ""


SHORT_S = 0.03
"""No foot lets go so soon."""
