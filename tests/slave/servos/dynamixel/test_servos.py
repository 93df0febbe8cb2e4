"""The thread around the bus, and the slave's whole loop over it."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from common.clock import NS_PER_S
from common.clock_sync import MasterExchange
from common.errors import RobotError
from common.link.config import LinkConfig
from common.process.pacing import DueTick, TickGrid
from common.wire.codec import decode, encode
from common.wire.control import read_reply
from common.wire.messages import Action, ClockReply, Command, CommandStamps, ControlReply, ControlRequest
from common.wire.topics import STATE, Topic
from slave import app
from slave.backends import ServosConfig
from slave.camera.config import CamerasConfig
from slave.config import SlaveConfig
from slave.guard.body import Body
from slave.guard.states import State
from slave.last_known import LastKnown, save
from slave.pipeline import SlavePipeline
from slave.servos.contract import Subject, check
from slave.servos.dynamixel.registers import TORQUE
from slave.servos.dynamixel.servos import DynamixelServos

if TYPE_CHECKING:
    from tests.slave.servos.dynamixel.conftest import Rig

TICK_NS = 5_000_000
COUNT_RAD = 2 * np.pi / 4096


def slave_config(rig: Rig) -> SlaveConfig:
    return SlaveConfig(
        robot="robot-1",
        profile="hand",
        link=LinkConfig(listen=["tcp/127.0.0.1:7447"]),
        servos=ServosConfig(backend="dynamixel", dynamixel=rig.config),
        encoders=rig.encoder_config,
        camera=CamerasConfig(source="off"),
    )


def until(happened: Callable[[], bool]) -> None:
    """Waits as long as a busy machine needs; the file's time-out ends it."""
    pause = threading.Event()
    while not happened():
        pause.wait(0.005)


@pytest.fixture
def patient(make_rig: Callable[..., Rig]) -> Rig:
    """A rig for a thread in real time: no watchdog or silence of a busy machine counts."""
    return make_rig(bus_watchdog_s=2.5, silent_after=50)


def test_the_newest_setpoint_arrives_and_the_newest_reading_is_there(patient: Rig) -> None:
    rig = patient
    rig.port._clock = StepClock()
    servos = DynamixelServos(rig.config, rig.skeleton, rig.encoder_config)
    assert not servos.read().valid.any()
    servos.start()
    try:
        with pytest.raises(RobotError, match="run already"):
            servos.start()
        first = servos.read()
        assert first.valid.all()
        target = np.full(len(rig.names), 0.5)
        servos.write(np.full(len(rig.names), 0.1))
        servos.write(target)
        until(lambda: bool(np.abs(rig.encoders.position_rad(servos.read().counts) - 0.5).max() <= COUNT_RAD))
        assert servos.read().read_ns > first.read_ns
        servos.quick_stop(True)
        servos.write(np.full(len(rig.names), 0.1))
        with rig.port.lock:
            rig.servos[4].power_cycle()
        # within a round of all servos' healths; so long they have held
        until(lambda: rig.names[4] in servos.faults())
        assert np.abs(rig.encoders.position_rad(servos.read().counts) - 0.5).max() <= COUNT_RAD
        servos.quick_stop(False)
        until(lambda: not servos.faults())
        until(lambda: bool(np.abs(rig.encoders.position_rad(servos.read().counts) - 0.1).max() <= COUNT_RAD))
    finally:
        servos.stop()
        servos.stop()
    assert not any(t.name == "dynamixel" for t in threading.enumerate())
    assert all(servo.get(TORQUE) for servo in rig.servos)


class StepClock:
    """Simulated servos' time: a little for every look, so that real time does not matter."""

    def __init__(self) -> None:
        self.now_ns = 0

    def __call__(self) -> int:
        self.now_ns += 2_000_000
        return self.now_ns


def test_they_keep_the_contract_of_all_backends(patient: Rig) -> None:
    patient.port._clock = StepClock()
    servos = DynamixelServos(patient.config, patient.skeleton, patient.encoder_config)
    pause = threading.Event()
    check(Subject(servos, patient.skeleton, patient.encoder_config, lambda: bool(pause.wait(0.005))))


@pytest.mark.parametrize("wrong", [np.zeros(3), np.full(14, np.nan)])
def test_a_setpoint_that_is_none_is_refused(patient: Rig, wrong: Any) -> None:
    servos = DynamixelServos(patient.config, patient.skeleton, patient.encoder_config)
    with pytest.raises(ValueError, match="14 finite angles"):
        servos.write(wrong)


def where(rig: Rig) -> dict[str, float]:
    """Where the joints stand, as it is known from before."""
    return dict(zip(rig.names, rig.start_rad.tolist(), strict=True))


class DeafLink:
    def __init__(self) -> None:
        self.put = 0
        """States."""

    def publish(self, topic: Topic) -> Callable[[bytes], None]:
        def put(_: bytes) -> None:
            self.put += topic is STATE

        return put

    def subscribe(self, *_: object, **__: object) -> None: ...

    def subscribe_keys(self, *_: object) -> None: ...

    def answer_keys(self, *_: object) -> None: ...

    def answer(self, *_: object) -> None: ...

    def watch_presence(self, *_: object) -> None: ...


def test_a_bus_that_hangs_holds_up_no_tick_of_the_slave(
    patient: Rig, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    rig = patient
    file = tmp_path / "robot-1.json"
    save(file, where(rig))

    async def given(grid: TickGrid) -> AsyncIterator[DueTick]:
        for tick in range(200):
            await asyncio.sleep(0)
            yield DueTick(tick, grid.origin_ns, 0)

    monkeypatch.setattr(app, "ticks", given)
    link: Any = DeafLink()
    servos = DynamixelServos(rig.config, rig.skeleton, rig.encoder_config)
    servos.start()
    try:
        slave = app.Slave(slave_config(rig), link, servos, last_known=LastKnown(file, rig.names))
        # no servo answers while this is held; were a tick to wait for one, it would never be let go
        with rig.port.lock:
            asyncio.run(slave._drive())
            servos.quick_stop(True)
        assert link.put == 50
        assert slave._pipeline.guard.state is State.HOLD
        # and then it goes on
        before_ns = servos.read().read_ns
        until(lambda: bool(servos.read().read_ns > before_ns and servos.read().valid.all()))
    finally:
        servos.stop()


class Session:
    """An operator and the slave's pipeline over the rig's driver, in the rig's own time."""

    def __init__(self, rig: Rig) -> None:
        self.rig = rig
        self.pipeline = SlavePipeline(slave_config(rig), last_known_rad=where(rig))
        self.sequence = 0
        self.lease = 0
        self.target = rig.start_rad.copy()
        self.fastest = np.zeros(len(rig.names))
        self.ticks = 0
        self.setpoint: Any = None
        rig.driver.start()
        master = MasterExchange(asker=8)
        for _ in range(8):
            self.run(0.25)
            query = encode(master.query(rig.now_ns))
            reply = decode(self.pipeline.on_clock(query, rig.now_ns, rig.now_ns), ClockReply)
            assert master.on_reply(reply, rig.now_ns)
        self.lease = self.ask(Action.CLAIM, clock=master.asker).lease
        self.run(0.2)
        challenge = self.ask(Action.STATUS).challenge
        assert self.ask(Action.ENGAGE, challenge=challenge).done

    def ask(self, action: Action, **more: Any) -> ControlReply:
        request = ControlRequest("robot-1", action, "anna", **more)
        return read_reply(self.pipeline.on_control(encode(request), self.rig.now_ns, sender="anna"), action)

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds * NS_PER_S / TICK_NS)):
            self._tick()

    def _tick(self) -> None:
        rig, self.ticks = self.rig, self.ticks + 1
        rig.now_ns += TICK_NS
        now_ns = rig.now_ns
        if self.lease and self.ticks % 16 == 0:
            self.sequence += 1
            self.pipeline.on_command(self._command(now_ns), now_ns, now_ns, sender="anna")
        body = Body(drives=rig.driver.faults)
        self.setpoint = self.pipeline.tick(now_ns, rig.driver.reading, body)
        if self.ticks % 2 == 0:
            estop = self.pipeline.guard.state is State.ESTOP
            before = np.array([servo.position for servo in rig.servos])
            setpoint = self.setpoint.position_rad if self.setpoint.ready else None
            rig.driver.cycle(setpoint, estop)
            rig.bus.advance(now_ns)
            way = np.abs(np.array([servo.position for servo in rig.servos]) - before) * COUNT_RAD
            self.fastest = np.maximum(self.fastest, way / (2 * TICK_NS / NS_PER_S))

    def _command(self, now_ns: int) -> bytes:
        count = len(self.rig.names)
        sampled_ns = now_ns - 10_000_000
        stamps = CommandStamps(sampled_ns, sampled_ns, sampled_ns, now_ns)
        ones, rest = np.ones(count, np.bool_), np.zeros(count)
        return encode(
            Command("robot-1", self.lease, self.sequence, self.ticks, stamps, True, ones, self.target, rest)
        )

    @property
    def state(self) -> State:
        return self.pipeline.guard.state


def test_the_whole_way_from_the_operators_command_to_the_servo(rig: Rig) -> None:
    session = Session(rig)
    session.run(0.6)
    assert session.state is State.TRACK
    session.target = np.full(len(rig.names), 0.5)
    session.run(3.0)  # a jump: as slowly as to the operator at first
    assert np.abs(rig.measured_rad - 0.5).max() <= 2 * COUNT_RAD
    limits = np.array([joint.max_velocity_rad_s for joint in rig.skeleton.joints])
    # no servo's encoder ever went faster than the table allows, but by the rounding of a count a cycle
    assert (session.fastest <= limits + COUNT_RAD / 0.01).all()
    assert rig.driver.missed == 0


def test_a_cable_pulled_in_motion_makes_the_robot_hold_and_says_so(rig: Rig) -> None:
    session = Session(rig)
    session.run(0.6)
    session.target = np.full(len(rig.names), 0.8)
    session.run(0.1)
    rig.port.pull()
    session.run(0.02)
    assert session.state is State.HOLD
    assert "port lost" in session.pipeline.guard.reason
    rig.now_ns += 300_000_000
    rig.bus.advance(rig.now_ns)
    before = [servo.position for servo in rig.servos]
    session.run(0.5)
    assert [servo.position for servo in rig.servos] == pytest.approx(before, abs=0.5)
    challenge = session.ask(Action.STATUS).challenge
    refused = session.ask(Action.ENGAGE, challenge=challenge)
    assert not refused.done


def test_an_estop_in_motion_stops_the_servos_where_they_are(rig: Rig) -> None:
    session = Session(rig)
    session.run(0.6)
    session.target = np.full(len(rig.names), 0.8)
    session.run(0.15)
    assert session.ask(Action.ESTOP).done
    at = rig.measured_rad
    session.run(0.5)
    assert session.state is State.ESTOP
    assert (np.abs(rig.measured_rad - at) < 0.15).all()
    still = rig.measured_rad
    session.run(0.3)
    assert (rig.measured_rad == still).all()
