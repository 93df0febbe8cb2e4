"""The slave's pipeline, without a clock, a link or a servo: gate ▸ motion ▸ write.

`on_command` takes a command through the gates to the robot's motion. `tick` asks the guard what may move, and
the motion where to; the caller writes the setpoint to the servos.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from common.clock_sync import Offset, SlaveExchange
from common.errors import CodecError
from common.link.access import operators_of
from common.link.namesakes import Namesakes
from common.link.revoked import revoked_operators
from common.quaternion import Array
from common.wire.codec import decode, encode
from common.wire.instance import draw_instance
from common.wire.lease import lease_id
from common.wire.messages import (
    BaseAttitude,
    ClockQuery,
    Command,
    Mask,
    RobotState,
)
from slave.announce import Announcer
from slave.config import SlaveConfig
from slave.contact.watch import ContactWatch
from slave.contact.zone_force import ZoneForces
from slave.encoders.counts import Encoders
from slave.guard import Admission, Guard
from slave.guard.body import WELL, Body
from slave.guard.control import Control
from slave.guard.lease import DrawToken, random_token
from slave.guard.states import MOVING
from slave.limit.limit import Setpoint
from slave.motion import RobotMotion
from slave.requests import Requests, UnreadMessages
from slave.servos.servos import EncoderReading
from slave.track import Tracker
from slave.traffic import CommandTraffic


class SlavePipeline:
    """Guard, motion and counters between ticks. `draw_token` makes the tokens of its leases."""

    def __init__(
        self,
        config: SlaveConfig,
        draw_token: DrawToken = random_token,
        instance: int = 0,
        place: str = "",
        *,
        last_known_rad: Mapping[str, float] | None = None,
        guard: Guard | None = None,
        tracker: Tracker | None = None,
    ) -> None:
        """`instance`: this process's number, drawn where it is 0; `place`: where it is, for people.

        `last_known_rad`: where the joints stood last, by joint. `guard`, `tracker`: others than configured.
        """
        self.robot = config.robot
        self.instance = instance or draw_instance()
        self.unread = UnreadMessages(config.robot)
        self.namesakes = Namesakes(self.instance)
        self.announcer = Announcer(config.robot, self.instance)
        self.skeleton = config.skeleton
        self.encoders = Encoders(self.skeleton, config.encoders)
        single = config.servos.single_reading(self.skeleton)
        undriven = config.servos.not_driven(self.skeleton)
        self._driven = np.array([name not in undriven for name in self.skeleton.joint_names])
        self.guard = guard or Guard(
            config.robot,
            self.skeleton,
            config.guard,
            last_known_rad={name: (last_known_rad or {}).get(name, np.nan) for name in single},
            draw_token=draw_token,
        )
        self.control = Control(config.guard.reset_key, operators_of(config.link.access, config.robot))
        contact = config.contact.for_loop(config.loop.rate_hz)
        self.contact = ContactWatch(self.skeleton, contact, config.servos.payload)
        self.zone_forces = ZoneForces(self.skeleton, config.guard.zones)
        self.motion = RobotMotion(config, self.contact, tracker)
        self.clock = SlaveExchange()
        self.traffic = CommandTraffic()
        self._requests = Requests(
            self.instance, place, self.control, self.clock, traffic=self.traffic, namesakes=self.namesakes,
            unread=self.unread,
        )  # fmt: skip
        self.on_accepted: Callable[[Command, int, Offset], None] | None = None
        """Called with every command that the guard accepts, now_ns, and the clocks' offset."""
        self.camera_fault = ""
        """Published with the state; no reason to stop moving."""
        self._states_sent = 0
        self._reading: EncoderReading | None = None
        self._body = WELL
        self.base: BaseAttitude | None = None
        """The base's attitude, if it carries a sensor; `Body.base` has what is wrong with it."""
        self._position_rad = np.zeros(len(self.skeleton.joints))
        self._setpoint = Setpoint(self._position_rad, np.zeros_like(self._position_rad), ready=False)

    def on_command(self, payload: bytes, received_ns: int, now_ns: int, *, sender: str | None) -> None:
        """Take a command from the link; whatever is wrong with it is counted and changes nothing.

        `sender`: the operator on whose key it arrived; None: a key of no operator.
        """
        try:
            command = decode(payload, Command, len(self.skeleton.joints))
            command = replace(command, operator=sender or "")
        except CodecError as error:
            self.unread.count("command", error, now_ns)
            return
        offset = self.clock.estimator.estimate(now_ns)
        best = self.clock.estimate(now_ns)
        # another operator's stamps are of another clock
        if command.lease and command.lease == self.guard.lease.token and sender == self.guard.operator:
            self.traffic.received(command, received_ns, best)
        if self.take(command, received_ns, now_ns, offset, best=best).accepted:
            self.traffic.journeys.accepted(command, received_ns, now_ns, best, self.guard.state in MOVING)
            if self.on_accepted is not None:
                self.on_accepted(command, now_ns, offset)

    def take(
        self,
        command: Command,
        received_ns: int,
        now_ns: int,
        offset: Offset,
        *,
        best: Offset | None = None,
    ) -> Admission:
        """Take a command: gate ▸ the robot's motion.

        `offset`: as the round trip proves it, for the gate. `best`: as the hosts' time services may know it
        better, for the tracker.
        A joint without a servo stays where it stands, as one of which the operator's angle is not known.
        """
        # what is no mask of the joints goes to the gate as it came, and is refused there
        if command.valid.shape == self._driven.shape and command.valid.dtype == np.bool_:
            command = replace(command, valid=command.valid & self._driven)
        admission = self.guard.admit(command, received_ns, now_ns, offset)
        if admission.accepted:
            self.motion.accept(self.guard, command, received_ns, now_ns, best or offset)
        return admission

    def on_stop(self, payload: bytes, now_ns: int) -> bytes:
        """Answer a client that may only stop the robot or ask for its status; every request is answered."""
        return self._requests.answer(self.guard, payload, now_ns)

    def on_control(self, payload: bytes, now_ns: int, *, sender: str | None) -> bytes:
        """Answer a request of a person or a master. Every request is answered.

        `sender`: the operator on whose key it arrived; None: a key of no operator.
        """
        return self._requests.answer_operator(self.guard, payload, now_ns, sender)

    def on_revoked(self, names: frozenset[str], now_ns: int) -> None:
        """Take the common names of the certificates that are revoked now."""
        self.guard.revoke(revoked_operators(names), now_ns)

    def on_clock(self, payload: bytes, received_ns: int, now_ns: int) -> bytes:
        """Answer the master's clock query. Raises CodecError, which the link counts."""
        reply = self.clock.on_query(decode(payload, ClockQuery), received_ns, now_ns)
        return encode(replace(reply, instance=self.instance))

    def tick(self, now_ns: int, reading: EncoderReading, body: Body = WELL) -> Setpoint:
        """One turn of the 200 Hz loop: what to write to the servos now."""
        namesake = self.namesakes.words(now_ns)
        body = body if namesake is None else replace(body, namesake=namesake)
        self._reading, self._body = reading, body
        self._position_rad = self.encoders.position_rad(reading.counts)
        self.contact.look(now_ns, reading, self._position_rad)
        self.zone_forces.look(self._position_rad, self.contact.external_nm, self.contact.threshold_nm)
        self.contact.also(self.zone_forces.finding)
        self._body = body = replace(body, contact=self.contact.fault(now_ns))
        self.traffic.journeys.read(reading)
        self._setpoint = self.step(
            now_ns, self._position_rad, reading.valid, reading.read_ns, body, drive_rad=reading.drive_rad
        )
        return self._setpoint

    def step(
        self,
        now_ns: int,
        position_rad: Array,
        valid: Mask,
        read_ns: int,
        body: Body = WELL,
        *,
        drive_rad: Array | None = None,
    ) -> Setpoint:
        """Gate ▸ motion, for joint angles (J,) as read at `read_ns`."""
        permission = self.guard.step(now_ns, position_rad, valid, read_ns, body, drive_rad=drive_rad)
        setpoint = self.motion.step(self.guard, now_ns, permission)
        if setpoint is None:
            return Setpoint(position_rad.copy(), np.zeros_like(position_rad), ready=False)
        self.guard.written(now_ns, setpoint.position_rad, setpoint.velocity_rad_s)
        return setpoint

    def written(self, now_ns: int) -> None:
        """Note that the setpoint of this turn has reached the servos."""
        if self._reading is not None and self.guard.state in MOVING:
            self.traffic.journeys.written(now_ns, self._reading.counts)

    def state(self, now_ns: int) -> bytes:
        """Encode what the robot does now."""
        self._states_sent += 1
        offset = self.clock.estimate(now_ns)
        reading = self._reading
        clamped = self.motion.take_clamped()
        return encode(
            RobotState(
                robot=self.robot,
                sequence=self._states_sent,
                sent_ns=now_ns,
                encoder_ns=reading.read_ns if reading else 0,
                guard=self.guard.state,
                reason=self.guard.reason,
                operator=self.guard.operator,
                encoder_valid=self._driven & reading.valid if reading else np.zeros_like(self._driven),
                position_rad=self._position_rad,
                setpoint_rad=self._setpoint.position_rad,
                echo=self.traffic.journeys.echo,
                master_offset_ns=offset.offset_ns,
                offset_bound_ns=offset.bound_ns if offset.trusted else -1,
                faults=self._faults(now_ns),
                base=self.base,
                lease_id=lease_id(self.guard.lease.token),
                instance=self.instance,
                resting=self.guard.resting.names,
                effort_nm=reading.effort_nm if reading else None,
                external_nm=self.contact.external_nm,
                blind_m=self.motion.blind.way_m,
                blind_s=self.motion.blind.after_s,
                clamped=clamped if clamped.any() else None,
                wanted_period_ms=self.traffic.rate.period_ms,
            )
        )

    def summary(self, now_ns: int) -> bytes | None:
        """The summary for lists of robots, if one is due."""
        return self.announcer.summary(now_ns, self.guard, self._faults(now_ns))

    @property
    def namesake(self) -> str | None:
        """Where another robot of this name is, as of the newest tick; None where none is known."""
        return self._body.namesake

    @property
    def position_rad(self) -> Array:
        """(J,) of the newest encoder reading."""
        return self._position_rad

    def _faults(self, now_ns: int) -> dict[str, str]:
        named = {"base": self._body.base, "name": self._body.namesake, "camera": self.camera_fault}
        named["distance"] = self.motion.damper.words
        named["contact"] = self._body.contact or self.contact.missing(now_ns)
        # a drive's own fault comes before the guard's doubt of its encoder
        others = {**self._body.stops, **self.guard.doubts, **self._body.drives}
        return {**others, **{name: words for name, words in named.items() if words}}
