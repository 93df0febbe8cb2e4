"""`[servos.dynamixel]`: the serial port, and which servo drives which joint."""

from __future__ import annotations

from collections.abc import Collection
from typing import Annotated

import numpy as np
from pydantic import Field

from common.errors import ConfigMistake
from common.skeleton import Skeleton
from slave.encoders.counts import COUNTS_PER_TURN, RAD_PER_COUNT, EncoderConfig
from slave.servos.backend import BackendConfig
from slave.servos.dynamixel.registers import GOAL_POSITION, HEALTH, PRESENT, PRESENT_POSITION, Register

WATCHDOG_UNIT_S = 0.02
_INSTRUCTION_BYTES = 14
_STATUS_BYTES = 11
_BITS_PER_BYTE = 10
"""Eight, a start and a stop bit."""
NO_CONSTANT = "its torque constant is not in servos.dynamixel.torque_nm_a"
_BUSY = 0.8
"""Share of a cycle that the wire may be busy for: the rest is the adapter's and the servos' own delay."""


class DynamixelConfig(BackendConfig):
    """`[servos.dynamixel]` of the slave's TOML. Zero and direction of the joints are `[encoders]`."""

    port: str = Field(min_length=1)
    """Serial device, such as `/dev/ttyUSB0` or a lasting name below `/dev/serial/by-id`."""
    baud: int = Field(1_000_000, ge=9_600, le=4_000_000)
    ids: dict[str, Annotated[int, Field(ge=0, le=252)]]
    """Bus id of every joint's servo."""
    rate_hz: int = Field(100, ge=10, le=500)
    """Cycles: setpoints written, positions read."""
    reply_timeout_s: float = Field(0.004, gt=0.0, le=1.0)
    """Waited for answers beyond the time that they take on the wire: the adapter's latency, mostly."""
    silent_after: int = Field(5, ge=1, le=50)
    """Cycles in a row without an answer after which a servo counts as gone."""
    bus_watchdog_s: float = Field(0.1, ge=WATCHDOG_UNIT_S, le=127 * WATCHDOG_UNIT_S)
    """Servos stop by themselves when nothing came over the bus for this long; in steps of 20 ms."""
    torque_nm_a: dict[str, Annotated[float, Field(gt=0.0, le=100.0)]] = Field(default_factory=dict)
    """N m at the horn for each ampere, by joint: the servo's torque constant times its gear. A joint that is
    not named tells no effort. Makers' stall torque over stall current is a first value."""
    rejoin_velocity_rad_s: float = Field(0.5, gt=0.0, le=2.0)
    """Speed of a servo that was gone, or stopped, on its way to where it should be."""

    @property
    def present(self) -> Register:
        """What is read of each servo in each cycle."""
        return PRESENT if self.torque_nm_a else PRESENT_POSITION

    def no_effort(self, skeleton: Skeleton) -> dict[str, str]:
        """Joints of which the file tells no torque constant."""
        return {n: NO_CONSTANT for n in skeleton.joint_names if n not in self.torque_nm_a}

    def single_reading(self, skeleton: Skeleton) -> Collection[str]:
        """All joints: the servo alone reads its angle."""
        return skeleton.joint_names

    def wire_time_s(self) -> float:
        """Time that one cycle's bytes take on the wire."""
        count = len(self.ids)
        write = _INSTRUCTION_BYTES + count * (1 + GOAL_POSITION.size)
        read = _INSTRUCTION_BYTES + count * (1 + _STATUS_BYTES + self.present.size)
        health = _INSTRUCTION_BYTES + _STATUS_BYTES + HEALTH.size
        return (write + read + health) * _BITS_PER_BYTE / self.baud

    def mistakes_for(self, skeleton: Skeleton, encoders: EncoderConfig) -> list[ConfigMistake]:
        """Joints without a servo, servos without a joint, and joints that a servo's one turn cannot serve."""
        return [*self._names(skeleton), *self._times(), *_wraps(skeleton, encoders)]

    def _names(self, skeleton: Skeleton) -> list[ConfigMistake]:
        names = set(skeleton.joint_names)
        key = "servos.dynamixel.ids"
        out = [
            ConfigMistake(f"{key}.{name}", i, f"a joint of the {skeleton.name} profile")
            for name, i in self.ids.items()
            if name not in names
        ]
        out += [
            ConfigMistake("servos.dynamixel.torque_nm_a", name, f"a joint of the {skeleton.name} profile")
            for name in self.torque_nm_a
            if name not in names
        ]
        missing = [name for name in skeleton.joint_names if name not in self.ids]
        out += [ConfigMistake(f"{key}.{name}", "(not set)", "the id of its servo") for name in missing]
        holder: dict[int, str] = {}
        for name, i in self.ids.items():
            if i in holder:
                out.append(ConfigMistake(f"{key}.{name}", i, f"an id of its own ({holder[i]} has this one)"))
            holder.setdefault(i, name)
        return out

    def _times(self) -> list[ConfigMistake]:
        period_s, wire_s = 1.0 / self.rate_hz, self.wire_time_s()
        out = []
        if wire_s > _BUSY * period_s:
            most = int(_BUSY / wire_s)
            expected = f"at most {most}: at {self.baud} baud a cycle's bytes take {1e3 * wire_s:.1f} ms"
            out.append(ConfigMistake("servos.dynamixel.rate_hz", self.rate_hz, expected))
        if self.bus_watchdog_s < 3.0 * period_s:
            expected = f"at least three cycles, {3.0 * period_s:g}"
            out.append(ConfigMistake("servos.dynamixel.bus_watchdog_s", self.bus_watchdog_s, expected))
        return out


def _wraps(skeleton: Skeleton, encoders: EncoderConfig) -> list[ConfigMistake]:
    """A servo in position mode never passes from 4095 to 0: it would go round the other way."""
    out = []
    for joint in skeleton.joints:
        sign = -1 if joint.name in encoders.reversed else 1
        ends = sorted(round(sign * rad / RAD_PER_COUNT) for rad in (joint.lower_rad, joint.upper_rad))
        least, most = max(0, -ends[0]), min(COUNTS_PER_TURN - 1, COUNTS_PER_TURN - 1 - ends[1])
        zero = encoders.zero_counts.get(joint.name, 0)
        if not least <= zero <= most:
            span = np.rad2deg(joint.upper_rad - joint.lower_rad)
            expected = f"{least} to {most}, so that its {span:.0f}° do not pass the servo's own end of turn"
            out.append(ConfigMistake(f"encoders.zero_counts.{joint.name}", zero, expected))
    return out
