"""Other processes with this robot's name, as far as they are known now. Pure: time is given."""

from __future__ import annotations

from common.clock import to_ns
from common.wire.presence import ProcessPresence

NOTICE_S = 2.0
"""How long a master's report of two robots with one name counts; it repeats it every NOTICE_S / 4."""


class Namesakes:
    """The robot's namesakes: those whose presence it sees, and those that a master reports to it."""

    def __init__(self, own: int) -> None:
        """`own`: this process's instance number."""
        self._own = own
        self._shown: dict[int, ProcessPresence] = {}
        self._notice = ""
        self._noticed_ns: int | None = None

    def on_presence(self, presence: ProcessPresence, here: bool) -> None:
        """A process showed itself, or went."""
        if presence.role != "slave" or presence.instance in (0, self._own):
            return
        if here:
            self._shown[presence.instance] = presence
        else:
            self._shown.pop(presence.instance, None)

    def on_notice(self, words: str, now_ns: int) -> None:
        """A master sees both and reports it; between peers the two do not see each other."""
        self._notice, self._noticed_ns = words, now_ns

    def words(self, now_ns: int) -> str | None:
        """Where another of this name is, for people; None where none is known."""
        if self._shown:
            places = " and ".join(sorted(each.words for each in self._shown.values()))
            return f"another robot has the same name: {places}. Give each its own name (`robot` in its file)"
        if self._noticed_ns is not None and abs(now_ns - self._noticed_ns) <= to_ns(NOTICE_S):
            return self._notice
        return None
