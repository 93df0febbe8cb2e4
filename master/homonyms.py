"""What a master does while two robots have one name: it reports both and claims neither. Pure."""

from __future__ import annotations

from common.clock import to_ns
from common.link.namesakes import NOTICE_S
from common.wire.messages import Action, ControlRequest
from common.wire.presence import ProcessPresence, several_bear

HEARD_S = 0.5
"""A robot that was not heard for this long no longer counts; a restart takes longer."""


class Homonyms:
    """Processes of one robot's name by the states that each sends; their places by what they show."""

    def __init__(self, robot: str, operator: str) -> None:
        self._robot = robot
        self._operator = operator
        self._heard: dict[int, int] = {}
        self._shown: dict[int, ProcessPresence] = {}
        self._next_notice_ns = 0
        self._logged: str | None = None

    def on_presence(self, presence: ProcessPresence, here: bool) -> None:
        """A process of the robot's name showed itself, or went."""
        if presence.role == "slave" and presence.instance and here:
            self._shown[presence.instance] = presence
        elif not here:
            self._shown.pop(presence.instance, None)

    def on_state(self, instance: int, now_ns: int) -> None:
        """A state of one of them came."""
        self._heard[instance] = now_ns

    def words(self, now_ns: int) -> str | None:
        """Names the robots that share the name; None where there is only one."""
        if len(self._heard) < 2:
            return None
        recent = [number for number, heard in self._heard.items() if abs(now_ns - heard) <= to_ns(HEARD_S)]
        self._heard = {number: self._heard[number] for number in recent}
        if len(recent) < 2:
            return None
        return several_bear(self._robot, [self._place(number) for number in recent])

    def notice(self, now_ns: int) -> ControlRequest | None:
        """The notice to send to all of them now, if one is due: each robot holds while notices arrive."""
        words = self.words(now_ns)
        if words is None or now_ns < self._next_notice_ns:
            return None
        self._next_notice_ns = now_ns + to_ns(NOTICE_S / 4)
        return ControlRequest(self._robot, Action.NAMESAKE, self._operator, words)

    def change(self, now_ns: int) -> str | None:
        """A line for the log when this changes."""
        words = self.words(now_ns)
        if words == self._logged:
            return None
        self._logged = words
        return words or f"only one robot has the name {self._robot} again"

    def _place(self, instance: int) -> str:
        shown = self._shown.get(instance)
        return shown.words if shown else f"an unknown place (instance {instance:08x})"
