"""Requests of people and masters: which are allowed, and the answers."""

from __future__ import annotations

import hmac

from common.wire.messages import Action, ControlReply, ControlRequest
from common.wire.together import TOGETHER
from slave.guard.admit import revocation
from slave.guard.challenge import Challenges
from slave.guard.engage import holder_only
from slave.guard.guard import Guard
from slave.guard.lease import WANTED_S


class Control:
    """Answers requests. Anybody may stop; only the lease's holder may move; only the key resets.

    What could lead to motion must be of now (`challenge.py`): what the network held back does nothing.
    """

    def __init__(self, reset_key: str, operators: frozenset[str] | None = None) -> None:
        """`operators`: who may command this robot; None: whoever reaches it."""
        self._operators = operators
        self._challenges = Challenges()
        self._reset_key = reset_key.encode()

    def answer(self, guard: Guard, request: ControlRequest, now_ns: int) -> ControlReply:
        """Do what is asked, or say why not."""
        guard.watch_arrivals(now_ns)
        if request.action is Action.ESTOP:
            # before any check: neither the sender nor the robot's name matters to a person in danger
            guard.estop(now_ns, f"e-stop by {request.operator or 'somebody'}")
            return ControlReply(True, guard.state, "stopped; only a reset with the key leaves the e-stop")
        if request.robot != guard.robot:
            return ControlReply(False, guard.state, f"this robot is {guard.robot}, not {request.robot}")
        operator, action = request.operator, request.action
        revoked = revocation(operator, guard.revoked)
        if revoked is not None and action is not Action.STATUS:
            return ControlReply(False, guard.state, revoked)
        if action is Action.CLAIM:
            return _claim(guard, operator, now_ns)
        if action is Action.STATUS:
            challenge = self._challenges.issue(now_ns)
            return ControlReply(True, guard.state, guard.reason, challenge=challenge)
        why, done = None, ""
        match action:
            case Action.NAMESAKE:
                done = "holds while two robots have its name"
            case Action.RELEASE:
                why, done = holder_only(operator, guard.operator), "the lease is free"
                if why is None:
                    guard.lease.let_go_by = operator
                    guard.release(now_ns, f"{operator} released the lease")
            case Action.TAKE:
                why = self._late(request, now_ns) or _not_free(guard, operator)
                if why is None and guard.operator != operator:
                    guard.lease.want(operator, now_ns)
                done = f"a master of {operator} that watches it claims it within {WANTED_S:g} s; then engage"
                if guard.operator == operator:
                    done = f"{operator} commands it already"
            case Action.DISENGAGE:
                why = holder_only(operator, guard.operator)
                if why is None:
                    guard.disengage(now_ns, f"disengaged by {operator}")
                done = guard.reason
            case Action.HANDOVER:
                why = holder_only(operator, guard.operator) or self._late(request, now_ns)
                why = why or self._no_successor(guard, request.key)
                if why is None:
                    guard.offer(request.key, now_ns)
                done = f"holds; {request.key} may take over now, or {operator} engages again"
            case Action.ENGAGE:
                why = self._late(request, now_ns)
                why = why or guard.engage(operator, now_ns, request.key == TOGETHER)
                done = "moves slowly to the operator's posture" + guard.resting.words
            case Action.REST:
                why = holder_only(operator, guard.operator) or guard.resting.rest(request.groups)
                done = "holds these joints" + guard.resting.words
            case Action.TAKE_UP:
                why = holder_only(operator, guard.operator) or self._late(request, now_ns)
                why = why or guard.resting.take_up(request.groups)
                done = "follows the operator again, slowly at first" + guard.resting.words
            case Action.RESET:
                reason = f"reset by {operator or 'somebody'}; engage to move"
                why = self._not_at_the_robot(
                    request, now_ns, "no reset key is configured: restart the slave at the robot"
                )
                why = why or guard.reset(now_ns, reason)
                done = "holds; engage to move"
            case Action.HOME:
                why = self._not_at_the_robot(
                    request, now_ns, "no reset_key is configured in [guard]: set one at the robot"
                )
                why = why or guard.home(now_ns)
                done = "the joint positions are confirmed"
        return ControlReply(why is None, guard.state, why or done)

    def _no_successor(self, guard: Guard, operator: str) -> str | None:
        """Why the lease cannot be offered to this operator, or None."""
        if not operator:
            return "name the operator to whom the robot is handed over"
        if operator == guard.operator:
            return f"{operator} holds the lease already"
        if self._operators is not None and operator not in self._operators:
            others = ", ".join(sorted(self._operators - {guard.operator})) or "nobody"
            return f"{operator} may not command this robot; [link.access] permits, beside you: {others}"
        return revocation(operator, guard.revoked)

    def _late(self, request: ControlRequest, now_ns: int) -> str | None:
        return self._challenges.refusal(request.challenge, now_ns)

    def _not_at_the_robot(self, request: ControlRequest, now_ns: int, no_key: str) -> str | None:
        """Why a request is refused that needs the key kept at the robot and must be fresh; or None."""
        if not self._reset_key:
            return no_key
        if not hmac.compare_digest(request.key.encode("utf-8", "replace"), self._reset_key):
            return "wrong reset key"
        return self._late(request, now_ns)


def not_on_own_key(named: str, sender: str | None) -> str | None:
    """Why a request that names an operator is not one of that operator's, or None. Pure.

    The key on which it came tells who sent it: only that is bound to a certificate.
    """
    if sender is None:
        return "the request did not come on the key of an operator"
    if named == sender:
        return None
    return f"the request is in the name of {named or 'nobody'}, but came from {sender or 'nobody'}"


def _not_free(guard: Guard, operator: str) -> str | None:
    """Why an operator's master could not claim the robot, or None."""
    if not operator:
        return "an operator needs a name"
    lease = guard.lease
    if guard.operator in ("", operator) or lease.offered_to == operator:
        return None
    return f"{guard.operator} holds the lease: ask for a hand-over (tandem handover --to {operator})"


def _claim(guard: Guard, operator: str, now_ns: int) -> ControlReply:
    if not operator:
        return ControlReply(False, guard.state, "an operator needs a name")
    token = guard.claim(operator, now_ns)
    if not token:
        return ControlReply(False, guard.state, f"{guard.operator} holds the lease")
    return ControlReply(True, guard.state, f"{operator} holds the lease now; engage to move", token)
