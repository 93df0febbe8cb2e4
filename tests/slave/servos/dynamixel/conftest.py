"""A hand of fourteen simulated servos on a pseudo-terminal, in time that only the test moves on."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

from common.quaternion import Array
from common.skeleton import load_skeleton
from slave.encoders.counts import EncoderConfig, Encoders
from slave.servos.dynamixel.config import DynamixelConfig
from slave.servos.dynamixel.driver import Driver
from tests.slave.servos.dynamixel.simulated.bus import SimulatedBus
from tests.slave.servos.dynamixel.simulated.pty import SimulatedPort
from tests.slave.servos.dynamixel.simulated.servo import SimulatedServo

PERIOD_NS = 10_000_000


class Rig:
    """Servos, port and driver. Answers have ample real time, so that a busy machine changes nothing."""

    def __init__(self, port: Callable[..., SimulatedPort], **changes: Any) -> None:
        self.skeleton = load_skeleton("hand")
        self.names = self.skeleton.joint_names
        self.now_ns = 1_000_000_000
        reversed_ = [self.names[3], self.names[7]]
        self.encoder_config = EncoderConfig(zero_counts=dict.fromkeys(self.names, 2048), reversed=reversed_)
        self.encoders = Encoders(self.skeleton, self.encoder_config)
        self.ids = {name: 10 + j for j, name in enumerate(self.names)}
        self.start_rad = np.full(len(self.names), 0.2)
        self.servos = [
            SimulatedServo(i, float(count))
            for i, count in zip(self.ids.values(), self.encoders.counts(self.start_rad), strict=True)
        ]
        self.bus = SimulatedBus(self.servos)
        self.port = port(self.bus, clock=self.clock)
        values: dict[str, Any] = {"reply_timeout_s": 1.0, **changes}
        self.config = DynamixelConfig(port=self.port.device, ids=self.ids, **values)
        assert self.config.mistakes_for(self.skeleton, self.encoder_config) == []
        self.driver = Driver(self.config, self.skeleton, self.encoder_config, self.clock)
        for servo, settings in zip(self.servos, self.driver._servos, strict=True):
            for register, value in settings.lasting:
                servo.put(register, value)

    def clock(self) -> int:
        return self.now_ns

    def cycles(self, count: int, setpoint_rad: Array | None = None, stop: bool = False) -> None:
        for _ in range(count):
            self.now_ns += PERIOD_NS
            self.driver.cycle(setpoint_rad, stop)

    @property
    def measured_rad(self) -> Array:
        return self.encoders.position_rad(self.driver.reading.counts)

    def wait_for_answers(self, seconds: float) -> None:
        """Less long, for servos that are going to be silent on purpose."""
        assert self.driver._bus is not None
        self.driver._bus._port.reply_timeout_s = seconds


@pytest.fixture
def make_rig() -> Iterator[Callable[..., Rig]]:
    with contextlib.ExitStack() as stack:

        def port(bus: SimulatedBus, **options: Any) -> SimulatedPort:
            return stack.enter_context(SimulatedPort(bus, **options))

        def make(**changes: Any) -> Rig:
            rig = Rig(port, **changes)
            stack.callback(rig.driver.close)
            return rig

        yield make


@pytest.fixture
def rig(make_rig: Callable[..., Rig]) -> Rig:
    return make_rig()
