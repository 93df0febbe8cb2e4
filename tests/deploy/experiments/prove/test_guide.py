"""Each step of a led proof ends by what is seen, and goes back where that is not so any more."""

from __future__ import annotations

from dataclasses import replace

import msgpack
import numpy as np

from common.clock import NS_PER_S
from common.wire.codec import decode, encode, state_joints
from common.wire.messages import RobotState
from deploy.experiments.prove.guide import ProofGuide, ProofStep
from deploy.experiments.prove.recorded import NodeRates
from master.journal.calls import FRAME, FRAMES, TICK, VERSION
from master.suit.number import number_of
from tests.deploy.experiments.prove.test_recorded import PROTOCOL, TAPED, WORN, rate, states

SECONDS = 16.0


class Session:
    """An operator, a robot and its node, as the master's tap tells of them."""

    def __init__(self) -> None:
        self.worn, self.taped = NodeRates(PROTOCOL, WORN), NodeRates(PROTOCOL, TAPED)
        self.guide = ProofGuide(self.worn, self.taped, "right_hand", TAPED, SECONDS, "tandem engage")
        self.now_ns, self._tick = NS_PER_S, 0
        self.answers, self.follows, self.moves, self.carried = False, False, 1.0, True
        self._state = states()[0].payload
        self.seen: list[ProofStep] = []
        self.line = ""

    def run(self, seconds: float) -> list[ProofStep]:
        """The steps that were shown, one after the other."""
        begun = len(self.seen)
        for _ in range(round(seconds * 200)):
            self._tick += 1
            self.now_ns += NS_PER_S // 200
            self._hand_on()
            if self._tick % 20 == 0:
                view = self.guide.look(self.now_ns)
                self.line = view.line
                if self.seen[-1:] != [view.step]:
                    self.seen.append(view.step)
        return self.seen[begun:]

    def _hand_on(self) -> None:
        calls: list[tuple[object, ...]] = [(TICK, self._tick, self.now_ns)]
        number = number_of(self._tick)
        speed = self.moves * rate(1e-9 * self.now_ns) / PROTOCOL.gyr_scale
        for node, turns in ((WORN, speed), (TAPED, speed if self.carried else np.zeros(3))):
            if node == WORN or self.answers:
                raw = np.zeros(9)
                raw[3:6] = turns
                frame = PROTOCOL.encode_sample(node, np.rint(raw).astype(np.int16), number, 0, True)[0]
                calls.append((FRAME, "suit", frame.id, bytes(frame.data), self.now_ns))
        self.guide.take(FRAMES, msgpack.packb((VERSION, calls)), self.now_ns)
        if self.follows and self._tick % 4 == 0:
            self.guide.take("tandem/robot-1/state", self._state, self.now_ns)


def test_it_leads_from_the_tape_to_the_end() -> None:
    session = Session()
    assert session.run(2.0) == [ProofStep.TAPE]
    assert "tape a node with number 100 to the robot's right hand" in session.line
    session.answers = True
    assert session.run(2.0) == [ProofStep.FOLLOW]
    assert "tandem engage" in session.line
    session.follows = True
    assert session.run(2.0) == [ProofStep.READY]
    assert "Begin in 4" in session.line
    assert session.run(4.0) == [ProofStep.MOVE]
    session.run(SECONDS / 2)
    assert "50 %" in session.line
    assert session.run(SECONDS / 2) == [ProofStep.DONE]


def moving() -> Session:
    session = Session()
    session.answers = session.follows = True
    session.run(6.5)
    assert session.guide.step is ProofStep.MOVE
    return session


def test_who_stands_still_is_told_and_it_does_not_count() -> None:
    session = moving()
    session.moves = 0.02
    session.run(5.0)
    counted = session.line[-5:]
    session.run(25.0)
    assert "too little" in session.line
    assert session.line[-5:] == counted
    session.moves = 1.0
    assert session.run(SECONDS + 5.0) == [ProofStep.DONE]


def test_a_node_that_fell_off_the_hand_is_told() -> None:
    session = moving()
    session.carried = False
    session.run(10.0)
    assert "is it on the robot's right hand?" in session.line


def test_a_robot_that_stops_following_is_engaged_again_and_what_counted_stays() -> None:
    session = moving()
    session.run(8.5)
    session.follows = False
    assert session.run(2.0) == [ProofStep.FOLLOW]
    session.follows = True
    assert session.run(7.0) == [ProofStep.READY, ProofStep.MOVE]
    assert "50 %" in session.line


def test_a_node_that_falls_silent_leads_back_to_the_tape() -> None:
    session = moving()
    session.answers = False
    assert session.run(3.0) == [ProofStep.TAPE]


def test_a_robot_that_holds_is_not_followed() -> None:
    session = moving()
    state = decode(session._state, RobotState, state_joints(session._state))
    session._state = encode(replace(state, guard="hold", reason="deadman released"))
    assert session.run(1.0) == [ProofStep.FOLLOW]
    assert "deadman released" in session.line
