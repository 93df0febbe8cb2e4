"""What people and masters may ask of a robot, who may ask it, and how they are answered."""

from __future__ import annotations

import hmac
from dataclasses import replace
from typing import Protocol

from common.wire.messages import Action, ControlReply, ControlRequest
from slave.guard.challenge import Challenges
from slave.guard.engage import holder_only
from slave.guard.lease import Lease
from slave.guard.states import State


class Controlled(Protocol):
    """The part of the guard that requests act on."""

    robot: str
    state: State
    reason: str
    lease: Lease

    def claim(self, operator: str, now_ns: int) -> int:
        """See Guard."""
        ...

    def release(self, now_ns: int, reason: str) -> None:
        """See Guard."""
        ...

    def engage(self, operator: str, now_ns: int) -> str | None:
        """See Guard."""
        ...

    def disengage(self, now_ns: int, reason: str) -> None:
        """See Guard."""
        ...

    def reset(self, now_ns: int, reason: str) -> str | None:
        """See Guard."""
        ...

    def estop(self, now_ns: int, reason: str) -> None:
        """See Guard."""
        ...

    def home(self, now_ns: int) -> str | None:
        """See Guard."""
        ...


class Control:
    """Answers requests. Anybody may stop; only the lease's holder may move; only the key resets.

    What could lead to motion must be of now (`challenge.py`): what the network held back does nothing.
    """

    def __init__(self, guard: Controlled, reset_key: str) -> None:
        self._guard = guard
        self._challenges = Challenges()
        self._reset_key = reset_key.encode()

    def answer(self, request: ControlRequest, now_ns: int) -> ControlReply:
        """Do what is asked, or say why not."""
        guard = self._guard
        if request.action is Action.ESTOP:
            # before any check: who it is from and whom it names does not matter to a person in danger
            guard.estop(now_ns, f"e-stop by {request.operator or 'somebody'}")
            return self._reply(True, "stopped; only a reset with the key leaves the e-stop")
        if request.robot != guard.robot:
            return self._reply(False, f"this robot is {guard.robot}, not {request.robot}")
        match request.action:
            case Action.CLAIM:
                return self._claim(request.operator, now_ns)
            case Action.RELEASE:
                return self._release(request.operator, now_ns)
            case Action.ENGAGE:
                why = self._late(request, now_ns) or guard.engage(request.operator, now_ns)
                return self._reply(why is None, why or "moves slowly to the operator's posture")
            case Action.DISENGAGE:
                return self._disengage(request.operator, now_ns)
            case Action.RESET:
                return self._reset(request, now_ns)
            case Action.NAMESAKE:
                return self._reply(True, "holds while two bear its name")
            case Action.HOME:
                return self._home(request, now_ns)
            case Action.STATUS:
                return replace(self._reply(True, guard.reason), challenge=self._challenges.issue(now_ns))

    def _late(self, request: ControlRequest, now_ns: int) -> str | None:
        return self._challenges.refusal(request.challenge, now_ns)

    def _claim(self, operator: str, now_ns: int) -> ControlReply:
        if not operator:
            return self._reply(False, "an operator needs a name")
        token = self._guard.claim(operator, now_ns)
        if not token:
            return self._reply(False, f"{self._guard.lease.operator} holds the lease")
        return self._reply(True, f"{operator} holds the lease now; engage to move", token)

    def _release(self, operator: str, now_ns: int) -> ControlReply:
        why = holder_only(operator, self._guard.lease.operator)
        if why is None:
            self._guard.release(now_ns, f"{operator} released the lease")
        return self._reply(why is None, why or "the lease is free")

    def _disengage(self, operator: str, now_ns: int) -> ControlReply:
        why = holder_only(operator, self._guard.lease.operator)
        if why is None:
            self._guard.disengage(now_ns, f"disengaged by {operator}")
        return self._reply(why is None, why or self._guard.reason)

    def _home(self, request: ControlRequest, now_ns: int) -> ControlReply:
        if not self._reset_key:
            return self._reply(False, "no reset_key is configured in [guard]: set one at the robot")
        why = self._wrong_key(request) or self._late(request, now_ns) or self._guard.home(now_ns)
        return self._reply(why is None, why or "the joints count as standing where the robot says they do")

    def _wrong_key(self, request: ControlRequest) -> str | None:
        right = hmac.compare_digest(request.key.encode("utf-8", "replace"), self._reset_key)
        return None if right else "wrong reset key"

    def _reset(self, request: ControlRequest, now_ns: int) -> ControlReply:
        if not self._reset_key:
            return self._reply(False, "no reset key is configured: restart the slave at the robot")
        if wrong := self._wrong_key(request):
            return self._reply(False, wrong)
        reason = f"reset by {request.operator or 'somebody'}; engage to move"
        why = self._late(request, now_ns) or self._guard.reset(now_ns, reason)
        return self._reply(why is None, why or "holds; engage to move")

    def _reply(self, done: bool, text: str, lease: int = 0) -> ControlReply:
        return ControlReply(done, self._guard.state, text, lease)
