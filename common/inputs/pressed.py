"""When a key asks for something: it was known to be up, and goes down. Pure."""

from __future__ import annotations


class PressedKey:
    """A key that is down when its device is opened, or comes back, asks nothing until it is pressed anew."""

    def __init__(self) -> None:
        self._presses = 0
        self._was_up = False

    def take(self, down: bool | None, presses: int) -> bool:
        """Take whether it is down (None: unknown) and how often it went down so far; True for a new press.

        A press that is over already counts too: some pedals press and release at once.
        """
        pressed = self._was_up and presses > self._presses
        self._presses, self._was_up = presses, down is False
        return pressed
