"""The doctor on a robot's servos: how late their port is, and how busy the drives' bus is."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from common.can.config import BusConfig
from deploy.ops.doctor.judge.can import judge_buses
from deploy.ops.doctor.judge.devices import judge_latency
from deploy.ops.doctor.judge.finding import Health
from deploy.ops.doctor.judge.needs import BusNeed
from deploy.ops.doctor.read.can import CanInterface
from deploy.ops.doctor.read.servos import PINGS, Pinged, ping_servos
from deploy.ops.doctor.read.tree import Tree
from slave.servos.canopen.load import bits_per_s
from slave.servos.dynamixel.config import DynamixelConfig
from tests.slave.servos.dynamixel.simulated.bus import SimulatedBus
from tests.slave.servos.dynamixel.simulated.pty import SimulatedPort
from tests.slave.servos.dynamixel.simulated.servo import SimulatedServo


@pytest.fixture
def port() -> Iterator[SimulatedPort]:
    with SimulatedPort(SimulatedBus([SimulatedServo(7)])) as port:
        yield port


def pinged(port: SimulatedPort, **changes: object) -> tuple[Pinged, DynamixelConfig]:
    config = DynamixelConfig.model_validate({"port": port.device, "ids": {"a": 3, "b": 7}, **changes})
    return ping_servos(config, Tree()), config


def late_by(seconds: float) -> Callable[[bytes], bytes]:
    def garble(answer: bytes) -> bytes:
        time.sleep(seconds)
        return answer

    return garble


def test_servos_are_pinged_past_a_silent_one_and_nothing_is_written(port: SimulatedPort) -> None:
    servo = port.bus.servos[7]
    before = bytes(servo._table)
    found, config = pinged(port, reply_timeout_s=0.1)
    assert found.answers == PINGS
    assert bytes(servo._table) == before
    assert judge_latency(found, config.reply_timeout_s).health is Health.OK


def test_a_late_port_fails_and_the_latency_timer_is_named(port: SimulatedPort) -> None:
    port.garble = late_by(0.017)
    found, config = pinged(port)
    finding = judge_latency(found, config.reply_timeout_s)
    assert finding.health is Health.FAIL
    assert "all would be called silent" in finding.found
    assert "latency timer" in finding.advice


@pytest.mark.parametrize(
    ("timer", "quickest_s", "health"),
    [
        (16, 0.0162, Health.FAIL),
        (16, 0.0035, Health.WARN),
        (16, None, Health.FAIL),
        (1, 0.0012, Health.OK),
        (None, 0.0012, Health.OK),
        (None, None, Health.OK),
        (1, 0.0041, Health.FAIL),
    ],
)
def test_timer_and_measurement_are_judged(
    timer: int | None, quickest_s: float | None, health: Health
) -> None:
    found = Pinged("/dev/ttyUSB0", timer, quickest_s, PINGS, "the port is in use")
    finding = judge_latency(found, 0.004)
    assert finding.health is health
    if health is not Health.OK and timer == 16:
        assert "latency timer of ttyUSB0 is 16 ms: set it to 1 ms" in finding.advice


def test_a_port_that_cannot_be_opened_and_one_that_must_not_be(tmp_path: Path) -> None:
    config = DynamixelConfig(port=str(tmp_path / "no-such-port"), ids={"a": 1})
    assert "No such file" in ping_servos(config, Tree()).why_not
    assert ping_servos(config, Tree(), None).why_not == "not asked to reach others"


@pytest.mark.parametrize(
    ("drives", "bitrate", "health"),
    [(25, 1_000_000, Health.FAIL), (18, 1_000_000, Health.WARN), (12, 1_000_000, Health.OK),
     (12, 500_000, Health.FAIL), (25, 0, Health.FAIL)],
)  # fmt: skip
def test_a_bus_s_load_is_judged_by_its_true_rate(drives: int, bitrate: int, health: Health) -> None:
    bus = BusConfig(name="left", interface="socketcan", channel="can0", fd=False)
    need = BusNeed(bus, rate_hz=200.0, drives=drives, bits_per_s=bits_per_s(drives, 200, 40, 100))
    there = CanInterface("can0", up=True, fd=False, bitrate=bitrate, state="ERROR-ACTIVE")
    (finding,) = judge_buses((need,), {"can0": there})
    assert finding.health is health
    assert f"{drives} drives at 200 Hz put" in finding.found
    if health is Health.FAIL:
        assert "sync_hz at most" in finding.advice
