"""Nodes of other makers, simulated: each samples by its own clock and sends its layout's frames unasked.

The frames are made by cantools from the DBC, so that nothing of the master's own reading is used.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from common.can.frame import EXTENDED, CanFrame
from common.quaternion import IDENTITY, Array, conjugate, multiply
from master.capture.layout import MappedLayout
from master.capture.parts import COUNTER, STAMP, TURN, Part

Reading = Callable[[float], tuple[Array, Array]]
"""A node's readings (9,), in the sensor's axes, and q_world_from_sensor (4,) at a time in s."""


@dataclass(frozen=True, slots=True)
class NodeClock:
    """How one node samples."""

    rate_hz: float
    phase_s: float = 0.0
    drift_ppm: float = 0.0
    """Its clock runs fast by so much."""
    begins_s: float = 0.0
    """What its clock shows at time 0."""
    throttled_hz: float = 0.0
    """It samples so often from `throttled_s` on, as one does that grows hot or is set anew; 0: never."""
    throttled_s: float = math.inf


class FreeNode:
    """One node of a layout."""

    def __init__(self, layout: MappedLayout, number: int, reading: Reading, clock: NodeClock) -> None:
        self.clock = clock
        self._layout = layout
        self._sends = layout.by_node[number]
        self._number = number
        self._reading = reading
        self._count = 0

    def restart(self) -> None:
        """Begin to count anew, as after a power loss."""
        self._count = 0

    def time_s(self, index: int) -> float:
        """True time of sample `index`."""
        clock = self.clock
        before = index
        if clock.throttled_hz:
            before = min(index, math.ceil((clock.throttled_s - clock.phase_s) * clock.rate_hz))
        own_s = before / clock.rate_hz + ((index - before) / clock.throttled_hz if index > before else 0.0)
        return clock.phase_s + own_s * (1.0 - 1e-6 * clock.drift_ppm)

    def count_until(self, until_s: float) -> int:
        """So many samples it takes until then."""
        return next(index for index in itertools.count() if self.time_s(index) > until_s)

    def frames(self, index: int) -> list[CanFrame]:
        """What it sends of sample `index`, its first message first."""
        time_s = self.time_s(index)
        readings, q = self._reading(time_s)
        layout = self._layout
        channels = np.zeros(15)
        channels[layout.take] = layout.signs * readings
        channels[TURN] = self._turn(q)
        own_s = self.clock.begins_s + time_s * (1.0 + 1e-6 * self.clock.drift_ppm)
        channels[STAMP] = own_s if not layout.stamp_wrap_s else own_s % layout.stamp_wrap_s
        channels[COUNTER] = self._count % max(layout.counter_wrap, 1)
        self._count += 1
        first = self._sends.first
        parts = [self._sends.parts[first], *(p for i, p in enumerate(self._sends.parts) if i != first)]
        return [self._frame(part, channels) for part in parts]

    def _turn(self, q_world_from_sensor: Array) -> Array:
        """(4,) in the unit's own world and axes: a quaternion or three angles."""
        layout, orientation = self._layout, self._layout.config.orientation
        if orientation is None:
            return IDENTITY
        q = multiply(conjugate(layout.q_world), multiply(q_world_from_sensor, layout.q_unit))
        if orientation.inverse:
            q = conjugate(q)
        if orientation.quaternion:
            return q
        from scipy.spatial.transform import Rotation

        turned = Rotation.from_quat(np.roll(q, -1))
        sequence = orientation.sequence
        angles: Array = turned.as_euler(sequence)  # type: ignore[call-overload]  # scipy types literals only
        return np.append(angles, 0.0)

    def _frame(self, part: Part, channels: Array) -> CanFrame:
        message = part.message
        values: dict[str, float | int] = {signal.name: 0 for signal in message.signals}
        values.update(part.selects)
        if self._layout.config.number_signal is not None:
            values[self._layout.config.number_signal] = self._number
        for each in part.mapped:
            conversion = each.signal.conversion
            raw = (channels[each.channel] / each.factor - conversion.offset) / conversion.scale
            values[each.signal.name] = (
                float(raw) if each.signal.is_float else _within(round(raw), each.signal)
            )
        data = bytes(message.encode(values, scaling=False, strict=False))
        frame_id = (message.frame_id + self._sends.step) | (EXTENDED if message.is_extended_frame else 0)
        return CanFrame(frame_id, data, bool(message.is_fd))


def _within(raw: int, signal: object) -> int:
    length, signed = int(getattr(signal, "length", 0)), bool(getattr(signal, "is_signed", False))
    if not signed:
        return raw % (1 << length)
    return max(-(1 << (length - 1)), min((1 << (length - 1)) - 1, raw))


@dataclass(frozen=True, slots=True)
class Sent:
    """A frame that reaches the bus at a time."""

    at_s: float
    bus: str
    frame: CanFrame


def sent_by(
    nodes: Mapping[str, list[FreeNode]],
    until_s: float,
    random: np.random.Generator,
    *,
    lost_share: float = 0.0,
    least_delay_s: float = 2e-4,
    jitter_s: float = 3e-4,
) -> Iterator[Sent]:
    """All frames of nodes by bus, in the order in which they arrive; delays vary, some frames are lost."""
    sent = []
    for bus, here in nodes.items():
        for node in here:
            for index in range(node.count_until(until_s)):
                at_s = node.time_s(index) + least_delay_s + random.exponential(jitter_s)
                for place, frame in enumerate(node.frames(index)):
                    if random.random() >= lost_share:
                        sent.append(Sent(at_s + 1.3e-4 * place, bus, frame))
    yield from sorted(sent, key=lambda each: each.at_s)
