"""The operator's commands at the gates: which are accepted, under whose lease, and when they came."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from common.clock import to_ns
from common.clock_sync import Offset
from common.wire.messages import Command, Mask
from slave.guard.admit import DEADMAN, GATES, Admission, Gate, Situation, admit
from slave.guard.config import GuardConfig
from slave.guard.events import GuardCounters
from slave.guard.lease import DrawToken, Lease, random_token


class CommandGate:
    """Judges one command after the other, and remembers what the newest accepted one said."""

    def __init__(
        self,
        robot: str,
        joints: int,
        config: GuardConfig,
        counters: GuardCounters,
        draw_token: DrawToken = random_token,
        gates: Sequence[Gate] = GATES,
    ) -> None:
        self.lease = Lease(to_ns(config.lease_timeout_s), draw_token)
        self.valid: Mask = np.zeros(joints, np.bool_)
        """(J,) joints that the newest accepted command gives a valid angle of."""
        self.operator_doubt = ""
        """Why the master would have nobody engage, as that command said; empty where it would."""
        self.arrived_ns: int | None = None
        """Arrival of the last accepted command, None where there was none since the last loss."""
        self.refusal = ""
        """Why the last command since then was refused, empty where none was."""
        self._robot = robot
        self._counters = counters
        self._gates = tuple(gates)
        self._max_age_ns = to_ns(config.max_age_s)
        self._future_tolerance_ns = to_ns(config.future_tolerance_s)
        self._newest_sequence = -1
        self._somebody_ns: int | None = None

    def judge(self, command: Command, received_ns: int, now_ns: int, offset: Offset) -> Admission:
        """Accept or refuse a command that arrived at `received_ns`. A refused one changes counters only.

        But where the deadman is released, nothing that came before this command may engage any more.
        """
        self.lease.lapse(now_ns)
        situation = Situation(
            self._robot, len(self.valid), self.lease.token, self._newest_sequence, now_ns, offset,
            self._max_age_ns, self._future_tolerance_ns,
        )  # fmt: skip
        admission = admit(command, situation, self._gates)
        if not admission.accepted:
            self._counters.dropped[admission.gate] += 1
            self.refusal = admission.reason
            if admission.gate == DEADMAN:
                self._newest_sequence, self.arrived_ns = command.sequence, None
            return admission
        self._counters.accepted += 1
        self.lease.renew(received_ns)
        self._newest_sequence, self.arrived_ns, self.refusal = command.sequence, received_ns, ""
        self.valid, self.operator_doubt = command.valid.copy(), command.doubt
        if command.valid.any():
            self._somebody_ns = received_ns
        return admission

    def somebody_ns(self, now_ns: int) -> int | None:
        """Now where the newest command has a valid joint, else arrival of the last that had one."""
        return now_ns if self.valid.any() else self._somebody_ns

    def claim(self, operator: str, now_ns: int) -> int:
        """The token of a new lease, or 0 where somebody holds one. Its commands are counted from 0."""
        token = self.lease.claim(operator, now_ns)
        if token:
            self._newest_sequence, self.arrived_ns, self.refusal = -1, None, ""
        return token
