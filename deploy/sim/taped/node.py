"""A node on the hand of a simulated robot that lives in another process. Pure.

It knows what the slave wrote to its drives, tick by tick, and so runs the same physics; of commands, encoders
and stamps it knows nothing, and so can judge them. The physics goes in cycles of 4 ms; between them, and up
to the SYNC that it answers, the hand's rate goes on straight.
"""

from __future__ import annotations

from collections import deque

import numpy as np

from common.can.frame import CanFrame
from common.clock import NS_PER_S
from common.errors import TandemError
from common.quaternion import Array
from common.skeleton import Skeleton
from deploy.sim.suit.imperfections import Imperfections
from deploy.sim.suit.sensors import CHANNELS
from master.suit.protocol import SuitProtocol
from slave.servos.mujoco.simulated import CYCLE_NS, SimulatedRobot
from slave.tap import RobotTick

KEPT = 64
"""Cycles, 0.25 s: as late as the node may be made to be."""
PAUSE_NS = NS_PER_S // 2
"""A longer silence of the slave is not made up for: its robot stood meanwhile."""
_GYRO = slice(3, 6)
_SEED = 12


class TapedNode:
    """Answers SYNCs with the rates of one link of the robot."""

    def __init__(
        self, skeleton: Skeleton, hand: str, protocol: SuitProtocol, node: int, *, fd: bool, late_ns: int = 0
    ) -> None:
        """`hand`: a segment. `late_ns`: a fault, readings that are so much older than the node says.

        Raises TandemError for a segment that the robot does not have.
        """
        if hand not in skeleton.segment_names:
            raise TandemError(f"{hand}: expected a segment: {', '.join(skeleton.segment_names)}")
        segment = skeleton.segments[skeleton.segment_names.index(hand)]
        self._skeleton, self._link = skeleton, segment.link or hand
        self._protocol, self._node, self._fd, self._late_ns = protocol, node, fd, late_ns
        self._errors = Imperfections("calibrated", 1, _SEED)
        self._robot: SimulatedRobot | None = None
        self._rates: deque[tuple[int, Array]] = deque(maxlen=KEPT)

    def on_tick(self, tick: RobotTick) -> None:
        """What the slave wrote to its drives, and when it had read their encoders before."""
        if self._robot is None:
            self._robot = SimulatedRobot(self._skeleton, None, tick.read_ns, tick.position_rad)
        self._advance(self._robot, tick.read_ns)
        if tick.ready:
            self._robot.write(tick.setpoint_rad)

    def answer(self, number: int, now_ns: int) -> list[CanFrame]:
        """The frames for a SYNC; none before the robot was heard."""
        if self._robot is None:
            return []
        self._advance(self._robot, now_ns)
        if len(self._rates) < 2:
            return []
        readings = np.zeros((1, CHANNELS))
        readings[0, _GYRO] = self._rate_at(now_ns - self._late_ns)
        felt = self._errors.apply(readings)[0]
        counts = np.zeros(CHANNELS)
        counts[_GYRO] = felt[_GYRO] / self._protocol.gyr_scale
        raw = np.clip(np.rint(counts), -32768, 32767).astype(np.int16)
        return list(self._protocol.encode_sample(self._node, raw, number, 0, self._fd))

    def _advance(self, robot: SimulatedRobot, until_ns: int) -> None:
        if until_ns - robot.now_ns > PAUSE_NS:
            robot.resume(until_ns)
            self._rates.clear()
        while robot.now_ns + CYCLE_NS <= until_ns:
            robot.advance(robot.now_ns + CYCLE_NS)
            self._rates.append((robot.now_ns - CYCLE_NS // 2, robot.rate_rad_s(self._link)))

    def _rate_at(self, at_ns: int) -> Array:
        """(3,) between the two cycles around that time, or on from the last two."""
        times_ns = [each for each, _ in self._rates]
        after = int(np.clip(np.searchsorted(times_ns, at_ns), 1, len(times_ns) - 1))
        (before_ns, before), (after_ns, rate) = self._rates[after - 1], self._rates[after]
        share = (at_ns - before_ns) / (after_ns - before_ns)
        out: Array = before + share * (rate - before)
        return out
