"""What the robot announces to every list of robots: its summary, and whether somebody there calls. Pure."""

from __future__ import annotations

from collections.abc import Sized

from common.clock import to_ns
from common.wire.call import CallRequest, pack_call_reply, read_call
from common.wire.summary import RobotSummary, encode_summary
from common.wire.topics import SUMMARY
from slave.call import Call
from slave.guard import Guard

_PERIOD_NS = round(1e9 / SUMMARY.rate_hz)
_SOONEST_NS = to_ns(0.1)
"""Between two summaries, however often things change: a flickering guard must not load a shared line."""


class Announcer:
    """Summaries of one robot process: one a second, and sooner where something changed that a list shows."""

    def __init__(self, robot: str, instance: int) -> None:
        self._robot = robot
        self._instance = instance
        self.call = Call()
        self._sequence = 0
        self._sent_ns: int | None = None
        self._next_ns = 0
        """When the next one falls due, whatever happens in between."""
        self._shown: tuple[object, ...] | None = None

    def on_call(self, payload: bytes, guard: Guard, now_ns: int) -> bytes:
        """Answer a person at the robot who calls an operator. Raises CodecError."""
        return pack_call_reply(self.call.take(read_call(payload), guard.operator, now_ns))

    def pressed(self, guard: Guard, now_ns: int) -> str:
        """The button at the robot was pressed: what came of it, for the log."""
        return self.call.take(CallRequest(True, "button at the robot"), guard.operator, now_ns).text

    def summary(self, now_ns: int, guard: Guard, faults: Sized) -> bytes | None:
        """The summary, if one is to be sent now."""
        self.call.look(guard.operator)
        shown = _shown(now_ns, guard, self.call)
        if not self._due(now_ns, shown):
            return None
        if self._fell_due(now_ns):
            # one a second over any time, though each is sent by the turn after it fell due
            late = not self._next_ns <= now_ns < self._next_ns + _PERIOD_NS
            self._next_ns = _PERIOD_NS + (now_ns if late else self._next_ns)
        self._sent_ns, self._shown = now_ns, shown
        self._sequence += 1
        lease = guard.lease
        return encode_summary(
            RobotSummary(
                self._robot,
                self._instance,
                self._sequence,
                str(guard.state),
                guard.reason,
                operator=guard.operator,
                offered_to=lease.offered_to,
                wanted_by=lease.wanted_by(now_ns),
                let_go_by=lease.let_go_by,
                faults=len(faults),
                call=self.call.shown(now_ns),
            )
        )

    def _due(self, now_ns: int, shown: tuple[object, ...]) -> bool:
        if self._sent_ns is None:
            return True
        if self._fell_due(now_ns):
            return True
        return now_ns - self._sent_ns >= _SOONEST_NS and shown != self._shown

    def _fell_due(self, now_ns: int) -> bool:
        # a clock that went back begins anew
        return not self._next_ns - _PERIOD_NS <= now_ns < self._next_ns


def _shown(now_ns: int, guard: Guard, call: Call) -> tuple[object, ...]:
    """What a change of is told at once; a reason that only counts seconds is not."""
    lease = guard.lease
    return guard.state, guard.operator, lease.offered_to, lease.wanted_by(now_ns), lease.let_go_by, call.waits
