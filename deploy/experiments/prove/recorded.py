"""A recorded run, judged by a node that was taped to the robot's hand. Pure: messages in, motions out.

The node answers the SYNC of the suit's bus, and its frames stand in the recording beside the suit's own. Or
it hangs on a bus at the robot, and a recording made there holds its frames by the robot's clock.
"""

from __future__ import annotations

from bisect import bisect_left
from collections import deque
from collections.abc import Iterable

import numpy as np

from common.clock_sync import Offset
from common.errors import CodecError, TandemError
from common.latency.one_way import master_offset
from common.metrics.slave import SlaveMetrics
from common.quaternion import Array
from common.skeleton import Skeleton
from common.wire.codec import decode
from common.wire.messages import RobotState, Statistics
from deploy.measure.delay import AngularSpeed, speed_of
from deploy.measure.proof import Claims, Motions
from deploy.recorded.recompute import Recorded
from master.journal.calls import FRAME, FRAMES, TICK, decode_calls
from master.suit.number import number_of
from master.suit.protocol import SuitProtocol
from slave.model.body import BodyModel

FOLLOWS = "track"
_GYRO = slice(3, 6)
SYNCS = 8
"""An answer to an older SYNC is none: nobody knows what it is of."""


class NodeRates:
    """The rates that one node of a bus told, by the time of the SYNC that it answered."""

    def __init__(self, protocol: SuitProtocol, node: int, bus: str = "") -> None:
        """`bus`: its name; empty: any, where the number is used once."""
        self._bus = bus
        form = protocol.fd
        self._whole = form.parts[0].base_id + node, form.parts[0], form.scale[_GYRO], _GYRO
        # of the three classic frames the second has the gyroscope's readings
        part = protocol.classic.parts[1]
        self._part = part.base_id + node, part, protocol.classic.scale[_GYRO], slice(0, 3)
        self._at_ns: list[int] = []
        self._rate_rad_s: list[Array] = []
        self._syncs: deque[tuple[int, int]] = deque(maxlen=SYNCS)
        """Number and time of the newest SYNCs."""

    def take(self, payload: bytes) -> None:
        """One message of the suit's frames. Raises RecordingError."""
        for call in decode_calls(payload):
            match call:
                case (int(kind), int(tick), int(now_ns)) if kind == TICK:
                    self._syncs.append((number_of(tick), now_ns))
                case (int(kind), str(bus), int(frame_id), bytes(data), int()) if kind == FRAME:
                    if not self._bus or bus == self._bus:
                        self._frame(frame_id, data)

    def _frame(self, frame_id: int, data: bytes) -> None:
        for wanted, part, scale, gyro in (self._whole, self._part):
            if frame_id != wanted or len(data) != part.length:
                continue
            read = part.decode(data)
            if read.folded[0] != part.crc.blank(frame_id):
                continue  # its checksum is wrong
            sync_ns = self._asked_ns(int(read.tick[0]), part.tick.mask)
            if sync_ns is not None and sync_ns > self._newest_ns:
                self._at_ns.append(sync_ns)
                self._rate_rad_s.append(read.raw[0, gyro] * scale)

    def _asked_ns(self, number: int, mask: int) -> int | None:
        """When the SYNC went out that an answer names: a busy node's answer may come after the next one."""
        return next((at_ns for sent, at_ns in reversed(self._syncs) if sent & mask == number), None)

    @property
    def _newest_ns(self) -> int:
        return self._at_ns[-1] if self._at_ns else -1

    @property
    def asked_ns(self) -> int:
        """When the newest SYNC went out; 0 before the first."""
        return self._syncs[-1][1] if self._syncs else 0

    def answers_since(self, since_ns: int) -> int:
        """How many SYNCs it answered since then."""
        return len(self._at_ns) - bisect_left(self._at_ns, since_ns)

    def speed_since(self, since_ns: int) -> Array:
        """(T,) rad/s: how fast it turned at each SYNC since then."""
        rates = self._rate_rad_s[bisect_left(self._at_ns, since_ns) :]
        return np.linalg.norm(rates, axis=1) if rates else np.zeros(0)

    def speed(self) -> AngularSpeed:
        """How fast it turned. A gyroscope's bias is the mean of a motion that comes back."""
        if not self._rate_rad_s:
            return AngularSpeed(np.zeros(0, np.int64), np.zeros(0))
        rates = np.array(self._rate_rad_s)
        return AngularSpeed(
            np.array(self._at_ns, np.int64), np.linalg.norm(rates - rates.mean(axis=0), axis=1)
        )


class RecordedRun:
    """Gathers from a recording of the master's tap what the proof needs."""

    def __init__(self, skeleton: Skeleton, hand: str) -> None:
        """`hand`: the segment of the robot that the node is taped to. Raises TandemError if there is none."""
        if hand not in skeleton.segment_names:
            raise TandemError(f"--hand {hand}: expected one of {', '.join(skeleton.segment_names)}")
        self._segment = skeleton.segment_names.index(hand)
        self._joints = len(skeleton.joints)
        self._body = BodyModel(skeleton)
        self._states: list[RobotState] = []
        self._offset: Offset | None = None
        self._metrics: SlaveMetrics | None = None
        self.unread = 0
        """Messages that could not be decoded."""

    def take(self, entries: Iterable[Recorded], nodes: Iterable[NodeRates]) -> None:
        """All messages of the recording. Raises RecordingError."""
        nodes = tuple(nodes)
        for topic, payload in entries:
            if topic == FRAMES:
                for node in nodes:
                    node.take(payload)
                continue
            try:
                self._message(topic.rpartition("/")[2], payload)
            except CodecError:
                self.unread += 1

    def _message(self, topic: str, payload: bytes) -> None:
        if topic == "state":
            state = decode(payload, RobotState, self._joints)
            if state.guard == FOLLOWS:
                self._states.append(state)
                offset = master_offset(state)
                self._offset = offset if offset.trusted else self._offset
        elif topic == "statistics":
            metrics = decode(payload, Statistics).metrics
            if isinstance(metrics, SlaveMetrics):
                self._metrics = metrics

    def claims(self) -> Claims:
        """What the robot's stamps said at last."""
        return Claims() if self._metrics is None else Claims(self._metrics.end_to_end_ms.mean)

    def motions(
        self, operator_hand: AngularSpeed, robot_hand: AngularSpeed, *, on_robots_clock: bool
    ) -> Motions:
        """Both hands, setpoint and encoder. Raises TandemError where the robot never followed."""
        if self._offset is None or len(self._states) < 2:
            raise TandemError(
                "the robot never followed the operator in this recording, or its clock is unknown"
            )
        ahead = self._offset.reversed()
        if not on_robots_clock:
            robot_hand = AngularSpeed(robot_hand.at_ns + ahead.offset_ns, robot_hand.rad_s)
        return Motions(
            operator_hand,
            self._hand([s.sent_ns for s in self._states], [s.setpoint_rad for s in self._states]),
            self._hand([s.encoder_ns for s in self._states], [s.position_rad for s in self._states]),
            robot_hand,
            ahead,
        )

    def _hand(self, at_ns: list[int], position_rad: list[Array]) -> AngularSpeed:
        turned = [self._body.at(each).r_base_from_segment[self._segment] for each in position_rad]
        return speed_of(np.array(at_ns, np.int64), np.array(turned))
