"""A node taped to the simulated robot's hand, a code before its camera, and faults planted between them.

The node is on the MuJoCo hand, has a SYNC and a phase of its own and a real node's errors. It knows nothing
of commands, setpoints or encoders, and so can judge them.
"""

from __future__ import annotations

from collections import deque
from dataclasses import replace

import numpy as np

from common.clock import NS_PER_MS
from common.picture_code import paste_code, read_codes, resolve_ns
from common.quaternion import Array
from common.wire.messages import RobotState
from deploy.measure.delay import AngularSpeed, speed_of
from deploy.measure.proof import Motions, SeenCode
from deploy.sim.suit.chain import Chain
from deploy.sim.suit.imperfections import Imperfections
from deploy.sim.suit.sensors import CHANNELS
from deploy.sim.suit.suit import SuitAnswer
from deploy.sim.world.injection import Traffic
from deploy.sim.world.world import PERIOD_NS, VirtualWorld
from slave.limit.limit import Setpoint
from slave.model.body import BodyModel
from slave.servos.mujoco.simulated import CYCLE_NS
from slave.servos.servos import EncoderReading

PLACES = ("servo", "encoder", "camera")
"""Where a delay can be planted."""
PICTURE_TICKS = 50
"""Slave's ticks from one picture to the next: 4 Hz."""
PICTURE_BYTES = 3_000
_CODE_AT_PX, _CELL_PX = (20, 20), 6
_GYRO = slice(3, 6)


class ProvedWorld:
    """A virtual world that is watched from outside; `hand` is a segment of its profile."""

    def __init__(
        self, world: VirtualWorld, hand: str = "right_hand", plant: dict[str, int] | None = None
    ) -> None:
        """`plant`: ms by place, whole ticks of 5 ms for servo and encoder."""
        self.world = world
        skeleton = world.slave_config.skeleton
        self._segment = skeleton.segment_names.index(hand)
        self._link = skeleton.segments[self._segment].link or hand
        self._chain, self._body = Chain(skeleton), BodyModel(skeleton)
        self._nodes = [Imperfections("calibrated", 1, seed) for seed in (11, 12)]
        self._operator: list[tuple[int, float]] = []
        self._robot: list[tuple[int, float]] = []
        self.true_operator: list[tuple[int, float]] = []
        """True time and true angular speed of the operator's hand."""
        self.true_robot: list[tuple[int, float]] = []
        self._pictures: list[SeenCode] = []
        self._plant = {place: (plant or {}).get(place, 0) for place in PLACES}
        self._written: deque[Array] = deque(maxlen=1 + self._ticks("servo"))
        self._readings: deque[EncoderReading] = deque(maxlen=1 + self._ticks("encoder"))
        self._turn = 0
        self._suit_answers = world.suit.on_sync
        world.suit.on_sync = self._on_sync  # type: ignore[method-assign]  # the node answers SYNC too
        world.inject.write, world.inject.read, world.inject.watch = self._write, self._read, self._watch

    def _ticks(self, place: str) -> int:
        return self._plant[place] * NS_PER_MS // PERIOD_NS

    def _on_sync(self, number: int, now_ns: int) -> SuitAnswer:
        answer = self._suit_answers(number, now_ns)
        truth = answer.truth
        if truth is not None:
            still = np.zeros_like(truth.position_rad)
            rate = self._chain.motion(truth.position_rad, truth.velocity_rad_s, still).rate_rad_s
            self.true_operator.append((self.world.now_ns, float(np.linalg.norm(rate[self._segment]))))
            self._operator.append((self.world.master_ns, self._felt(0, rate[self._segment])))
        return answer

    def _felt(self, node: int, rate_rad_s: Array) -> float:
        """What a node with a real one's errors tells of its rate."""
        readings = np.zeros((1, CHANNELS))
        readings[0, _GYRO] = rate_rad_s
        return float(np.linalg.norm(self._nodes[node].apply(readings)[0, _GYRO]))

    def _write(self, position_rad: Array) -> Array:
        self._written.append(position_rad.copy())
        return self._written[0]

    def _read(self, reading: EncoderReading) -> EncoderReading:
        """The counts of some ticks ago, with the stamp of now: what a driver that buffers does."""
        self._readings.append(reading)
        return replace(self._readings[0], read_ns=reading.read_ns)

    def _watch(self, reading: EncoderReading, _: Setpoint) -> None:
        rate = self.world.simulated.rate_rad_s(self._link)
        # the encoders were latched at the end of the physics' last cycle, its rates are of the cycle's middle
        late_ns = self.world.slave_ns - reading.read_ns + CYCLE_NS // 2
        self.true_robot.append((self.world.now_ns - late_ns, float(np.linalg.norm(rate))))
        self._robot.append((self.world.slave_ns - late_ns, self._felt(1, rate)))
        self._turn += 1
        if self._turn % PICTURE_TICKS == 0:
            self._take_picture()

    def _take_picture(self) -> None:
        shown_ns = self.world.slave_ns
        pixels = np.full((240, 320, 3), 127, np.uint8)
        paste_code(pixels, shown_ns, _CODE_AT_PX, _CELL_PX)
        stamp_ns = shown_ns + self._plant["camera"] * NS_PER_MS

        def on_screen() -> None:
            codes = read_codes(pixels)
            if codes:
                scene_ns = resolve_ns(codes[0].count, stamp_ns)
                self._pictures.append(SeenCode(scene_ns, stamp_ns, self.world.master_ns))

        self.world.link.send(Traffic.STATE, self.world.now_ns, PICTURE_BYTES, on_screen)

    def forget(self) -> None:
        """What came so far is not judged."""
        for rows in (self._operator, self._robot, self.true_operator, self.true_robot):
            rows.clear()
        self._pictures.clear()
        self._since = len(self.world.states)

    _since = 0

    def motions(self) -> Motions:
        """The run since, as an outsider knows it."""
        states = self.world.states[self._since :]
        return Motions(
            operator_hand=_speed(self._operator),
            setpoint=self._hand([s.sent_ns for s in states], states, "setpoint_rad"),
            encoder=self._hand([s.encoder_ns for s in states], states, "position_rad"),
            robot_hand=_speed(self._robot),
            offset=self.world.clock.estimate(self.world.master_ns),
            pictures=tuple(self._pictures),
        )

    def _hand(self, at_ns: list[int], states: list[RobotState], of: str) -> AngularSpeed:
        turned = [self._body.at(getattr(s, of)).r_base_from_segment[self._segment] for s in states]
        return speed_of(np.array(at_ns, np.int64), np.array(turned))

    def truth(self) -> tuple[AngularSpeed, AngularSpeed]:
        """Both hands without any error, on one true clock."""
        return _speed(self.true_operator), _speed(self.true_robot)


def _speed(rows: list[tuple[int, float]]) -> AngularSpeed:
    return AngularSpeed(np.array([at for at, _ in rows], np.int64), np.array([rate for _, rate in rows]))
