"""Which robots of one name have acknowledged a stop, and which have not. Pure."""

from __future__ import annotations

from common.wire.presence import ProcessPresence, several_bear
from common.wire.stop import StopAnswer
from deploy.client.answer import RobotAnswer


class StopCount:
    """Counts by instance: each that shows itself must acknowledge, and at least one must."""

    def __init__(self, robot: str, within_s: float) -> None:
        self._robot = robot
        self._within_s = within_s
        self._shown: dict[int, ProcessPresence] = {}
        self._stopped: dict[int | str, RobotAnswer] = {}
        """Acknowledgements by instance, or by session for a robot of schema 2, which has no instance."""

    def expect(self, presence: ProcessPresence) -> None:
        """A process of this name showed itself. One that goes again is not known to be stopped."""
        if presence.instance:
            self._shown[presence.instance] = presence

    def on_answer(self, answer: StopAnswer, session: str) -> RobotAnswer | None:
        """Count an answer. Returns it for the report if it is a new acknowledgement, else None."""
        replier = answer.instance or session
        if not answer.stopped or replier in self._stopped:
            return None
        shown = self._shown.get(answer.instance)
        place = shown.words if shown is not None and self.several else ""
        acknowledged = RobotAnswer(self._robot, True, answer.text, answer.guard, answer.instance, place)
        self._stopped[replier] = acknowledged
        return acknowledged

    @property
    def complete(self) -> bool:
        """Whether at least one process has acknowledged, and every process that announced itself."""
        return bool(self._stopped) and not self._silent()

    def answers(self) -> list[RobotAnswer]:
        """One a process: stopped, or not."""
        return [*self._stopped.values(), *self.failures()]

    def failures(self) -> list[RobotAnswer]:
        """The processes that were asked or announced themselves, and did not acknowledge."""
        text = f"NOT STOPPED by this: no answer within {self._within_s:g} s. Stop it at the robot itself"
        silent = [
            RobotAnswer(self._robot, False, text, instance=each.instance, place=each.words)
            for each in self._silent()
        ]
        return silent if silent or self._stopped else [RobotAnswer(self._robot, False, text)]

    def namesakes(self) -> str | None:
        """The warning if several robots have the name, else None."""
        if not self.several:
            return None
        return several_bear(self._robot, [each.words for each in self._shown.values()] or ["unknown places"])

    @property
    def several(self) -> bool:
        """Whether more than one process bears the name, as far as is known."""
        return len(self._shown.keys() | self._stopped.keys()) > 1

    def _silent(self) -> list[ProcessPresence]:
        return [presence for number, presence in self._shown.items() if number not in self._stopped]
