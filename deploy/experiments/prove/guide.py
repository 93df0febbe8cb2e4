"""What the person who proves is to do now: a state machine on the messages of the master's tap. Pure.

    tape ▸ follow ▸ ready ▸ move ▸ done

Each step ends by what is seen, not by what somebody says: the node answers, the robot follows, the hand moves
enough. Where the robot stops following, it is led back to `follow`; segments that counted stay counted.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from common.clock import NS_PER_S, to_ns, to_s
from common.errors import CodecError
from common.wire.codec import decode, state_joints
from common.wire.messages import RobotState
from deploy.experiments.prove.recorded import FOLLOWS, NodeRates
from deploy.measure.delay import LEAST_SPEED, SEGMENT_S
from master.journal.calls import FRAMES

READY_S = 5.0
HEARD_NS = NS_PER_S
"""A node or a robot that was silent for longer is not there."""
LEAST_ANSWERS = 50
"""In that time, of 200: a node that hangs on a loose plug answers now and then."""
STILL_RAD_S = 0.05
"""A robot's hand that moves by less, while the operator's moves, does not carry the node."""


class ProofStep(StrEnum):
    """What is to be done."""

    TAPE = "tape"
    FOLLOW = "follow"
    READY = "ready"
    MOVE = "move"
    DONE = "done"


STEPS = tuple(ProofStep)


@dataclass(frozen=True, slots=True)
class ProofView:
    """What to show."""

    step: ProofStep
    todo: str
    share: float
    """0 to 1, of this step."""

    @property
    def line(self) -> str:
        """In one line."""
        number = STEPS.index(self.step) + 1
        done = f" {100.0 * self.share:.0f} %" if self.step is ProofStep.MOVE else ""
        return f"step {number} of {len(STEPS)}: {self.todo}{done}"


class ProofGuide:
    """Leads through one proof. Times are ns of the operator's host, as the tap's."""

    def __init__(
        self, worn: NodeRates, taped: NodeRates, hand: str, node: int, seconds: float, engage: str
    ) -> None:
        """`worn`, `taped`: of the operator's hand and the robot's. `seconds`: how long it is to be moved.

        `engage`: the command by which the robot is engaged.
        """
        self._worn, self._taped = worn, taped
        self._hand, self._node, self._engage = hand.replace("_", " "), node, engage
        self._wanted = math.ceil(seconds / SEGMENT_S)
        self._segments = 0
        self._segment_ns: int | None = None
        self._ready_ns: int | None = None
        self._guard, self._reason, self._heard_ns = "", "it was not heard yet", 0
        self._hint = ""
        self.step = ProofStep.TAPE

    def take(self, topic: str, payload: bytes, now_ns: int) -> None:
        """One message of the tap. Raises RecordingError."""
        if topic == FRAMES:
            self._worn.take(payload)
            self._taped.take(payload)
        elif topic.endswith("/state"):
            try:
                state = decode(payload, RobotState, state_joints(payload))
            except CodecError:
                return
            self._guard, self._reason, self._heard_ns = state.guard, state.reason, now_ns

    def look(self, now_ns: int) -> ProofView:
        """Which step it is now, and what to do. To be called some times a second."""
        if self.step is not ProofStep.DONE:
            self._go_on(now_ns)
        return ProofView(self.step, self._todo(now_ns), self._share(now_ns))

    def _go_on(self, now_ns: int) -> None:
        # by the SYNCs' own time: a host that is behind with reading must not look like a silent node
        if self._taped.answers_since(self._taped.asked_ns - HEARD_NS) < LEAST_ANSWERS:
            self._to(ProofStep.TAPE)
        elif not self._follows(now_ns):
            self._to(ProofStep.FOLLOW)
        elif self.step in (ProofStep.TAPE, ProofStep.FOLLOW):
            self._to(ProofStep.READY)
            self._ready_ns = now_ns
        elif self.step is ProofStep.READY and self._left_s(now_ns) <= 0.0:
            self._to(ProofStep.MOVE)
            self._segment_ns = now_ns
        elif self.step is ProofStep.MOVE:
            self._judge_segment(now_ns)

    def _to(self, step: ProofStep) -> None:
        self.step, self._segment_ns, self._hint = step, None, ""

    def _follows(self, now_ns: int) -> bool:
        return self._guard == FOLLOWS and now_ns - self._heard_ns < HEARD_NS

    def _judge_segment(self, now_ns: int) -> None:
        begun_ns = self._segment_ns
        if begun_ns is None or now_ns - begun_ns < to_ns(SEGMENT_S):
            return
        self._segment_ns = now_ns
        worn, taped = (node.speed_since(begun_ns) for node in (self._worn, self._taped))
        if not len(worn) or worn.std() < LEAST_SPEED:
            self._hint = "that was too little: faster, and further"
        elif not len(taped) or np.ptp(taped) < STILL_RAD_S:
            self._hint = f"node {self._node} did not move: is it on the robot's {self._hand}?"
        else:
            self._hint = ""
            self._segments += 1
            if self._segments >= self._wanted:
                self._to(ProofStep.DONE)

    def _left_s(self, now_ns: int) -> float:
        return READY_S if self._ready_ns is None else READY_S - to_s(now_ns - self._ready_ns)

    def _share(self, now_ns: int) -> float:
        match self.step:
            case ProofStep.READY:
                return min(1.0, 1.0 - self._left_s(now_ns) / READY_S)
            case ProofStep.MOVE | ProofStep.DONE:
                return self._segments / self._wanted
        return 0.0

    def _todo(self, now_ns: int) -> str:
        match self.step:
            case ProofStep.TAPE:
                return (
                    f"tape a node with number {self._node} to the robot's {self._hand}, on the suit's bus; "
                    "how it sits does not matter. It does not answer yet"
                )
            case ProofStep.FOLLOW:
                told = self._reason if now_ns - self._heard_ns < HEARD_NS else "it is not heard"
                return f"engage the robot ({self._engage}); it does not follow: {told}"
            case ProofStep.READY:
                return f"stand; keep your trunk still. Begin in {math.ceil(self._left_s(now_ns))}"
            case ProofStep.MOVE:
                words = f"move your {self._hand} irregularly, about all axes, with short pauses; trunk still"
                return f"{words} ({self._hint})" if self._hint else words
        return "done: let the robot go (tandem disengage)"
