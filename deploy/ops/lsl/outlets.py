"""The streams of one robot, and what each message puts into them (extra `lsl`).

LSL's clock is CLOCK_MONOTONIC, tandem's CLOCK_MONOTONIC_RAW: the two run apart by as much as the host's clock
is steered. Both are read at the same instant, and each stamp is carried over by their difference then.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from common.clock import Clock, monotonic_ns, to_s
from common.errors import CodecError
from common.latency.one_way import master_offset, one_way_ns
from common.skeleton import Skeleton
from common.wire.codec import decode
from common.wire.messages import Command, RobotState
from common.wire.topics import COMMAND, STATE

if TYPE_CHECKING:
    from pylsl import StreamOutlet

RAD = "radians"
LATENCY = (("one_way", "seconds"), ("bound", "seconds"))


@dataclass(frozen=True, slots=True)
class LslStream:
    """What a stream is called, and its channels with their units."""

    name: str
    kind: str
    rate_hz: float
    """0: whenever something happens."""
    channels: tuple[tuple[str, str], ...]
    text: bool = False


def streams_of(robot: str, skeleton: Skeleton) -> dict[str, LslStream]:
    """The streams of a robot, by what they hold."""
    joints = tuple((name, RAD) for name in skeleton.joint_names)
    return {
        "joints": LslStream(f"{robot}_joints", "MoCap", STATE.rate_hz, joints),
        "targets": LslStream(f"{robot}_targets", "MoCap", STATE.rate_hz, joints),
        "operator": LslStream(f"{robot}_operator", "MoCap", COMMAND.rate_hz, joints),
        "latency": LslStream(f"{robot}_latency", "Latency", 0.0, LATENCY),
        "markers": LslStream(f"{robot}_markers", "Markers", 0.0, (("event", ""),), text=True),
    }


def outlet_of(stream: LslStream, source: str) -> StreamOutlet:
    """Open one; `source` lets a recorder find it again after a restart. Raises ModuleNotFoundError."""
    import pylsl

    kind = pylsl.cf_string if stream.text else pylsl.cf_double64
    info = pylsl.StreamInfo(
        stream.name, stream.kind, len(stream.channels), stream.rate_hz or pylsl.IRREGULAR_RATE, kind,
        f"tandem:{source}:{stream.name}",
    )  # fmt: skip
    described = info.desc().append_child("channels")
    for label, unit in stream.channels:
        channel = described.append_child("channel")
        channel.append_child_value("label", label)
        channel.append_child_value("unit", unit)
        channel.append_child_value("type", stream.kind)
    return pylsl.StreamOutlet(info)


class LslPublisher:
    """Puts states and commands into the streams. No operator's name leaves: markers hold states alone."""

    def __init__(self, robot: str, skeleton: Skeleton, clock: Clock = monotonic_ns) -> None:
        import pylsl

        self._joints = len(skeleton.joints)
        self._outlets = {key: outlet_of(stream, robot) for key, stream in streams_of(robot, skeleton).items()}
        self._clock = clock
        self._lsl_clock: Callable[[], float] = pylsl.local_clock
        self._guard = ""
        self._faulty: frozenset[str] = frozenset()
        self._echoed = -1
        self.sent = dict.fromkeys(self._outlets, 0)
        self.unreadable = 0

    def state(self, payload: bytes, arrived_ns: int) -> None:
        """Joints and targets, stamped by the arrival less the time since the encoders were read."""
        try:
            state = decode(payload, RobotState, self._joints)
        except CodecError:
            self.unreadable += 1
            return
        read_s = self._lsl_s(arrived_ns - max(0, state.sent_ns - state.encoder_ns))
        measured = np.where(state.encoder_valid, state.position_rad, np.nan)
        self._push("joints", measured.tolist(), read_s)
        self._push("targets", state.setpoint_rad.tolist(), read_s)
        arrived_s = self._lsl_s(arrived_ns)
        if state.guard != self._guard:
            self._guard = state.guard
            self.mark(f"guard {state.guard}", arrived_s)
        faulty = frozenset(state.faults)
        for part in sorted(faulty - self._faulty):
            self.mark(f"fault {part}", arrived_s)
        for part in sorted(self._faulty - faulty):
            self.mark(f"well {part}", arrived_s)
        self._faulty = faulty
        self._latency(state, arrived_s)

    def _latency(self, state: RobotState, arrived_s: float) -> None:
        echo, offset = state.echo, master_offset(state)
        if echo is None or echo.sequence == self._echoed:
            return
        self._echoed = echo.sequence
        one_way = one_way_ns(echo.put_ns, echo.received_ns, offset)
        if one_way is not None:
            self._push("latency", [to_s(one_way), to_s(offset.bound_ns)], arrived_s)

    def command(self, payload: bytes, arrived_ns: int) -> None:
        """What the operator asked for, as it came here."""
        try:
            command = decode(payload, Command, self._joints)
        except CodecError:
            self.unreadable += 1
            return
        known = np.where(command.valid, command.position_rad, np.nan)
        self._push("operator", known.tolist(), self._lsl_s(arrived_ns))

    def mark(self, text: str, at_s: float | None = None) -> None:
        """An event."""
        self._push("markers", [text], self._lsl_clock() if at_s is None else at_s)

    def _push(self, key: str, sample: list[float] | list[str], at_s: float) -> None:
        self._outlets[key].push_sample(sample, at_s)
        self.sent[key] += 1

    def _lsl_s(self, at_ns: int) -> float:
        return self._lsl_clock() + to_s(at_ns - self._clock())
