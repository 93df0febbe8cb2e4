"""A switch that a person must be holding: one that was down from the start is not believed. Pure."""

from __future__ import annotations


class HeldSwitch:
    """Counts a press only after the switch has been seen released since it is known at all.

    A pedal that is taped down, stuck, or under a chair's leg when its device is opened does not arm by
    itself; nor does one that was held while its device was away.
    """

    def __init__(self) -> None:
        self._seen_released = False
        self._releases = 0
        self.held = False
        self.words = "not known yet"
        """Why it is not held; empty where it is."""

    def take(self, down: bool | None, releases: int = 0, words: str = "") -> bool:
        """Take whether the switch is down (None: unknown, because of `words`); True while it is held.

        `releases`: how often it has gone up so far. It may have gone up and down again since the last look:
        that look does not find it held, the next one does.
        """
        let_go, self._releases = releases != self._releases, releases
        if down is None:
            self._seen_released = False
        elif not down or let_go:
            self._seen_released = True
        self.held = bool(down) and self._seen_released and not let_go
        if self.held:
            self.words = ""
        elif down is None:
            self.words = words or "not known"
        elif down and not let_go:
            self.words = "was pressed already when it was first read: release it, then press it"
        else:
            self.words = "released"
        return self.held
