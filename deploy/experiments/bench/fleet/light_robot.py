"""A robot without a body: real link, real guard, real codec, no drives, no simulator.

It stands where it is; it answers, grants its lease and announces itself as a slave does, and publishes its
state at 50 Hz while somebody hears it. Its guard is stepped at 10 Hz then, else at 2.5 Hz; a real slave steps
it at 200 Hz, on a computer of its own. A state is encoded anew where it says something new; in between only
its number and stamps are written into the bytes, so that one computer can serve a hundred robots.
"""

from __future__ import annotations

import struct
from dataclasses import replace

import numpy as np

from common.clock import monotonic_ns
from common.clock_sync import SlaveExchange
from common.errors import CodecError
from common.link import LinkSession
from common.link.namesakes import Namesakes
from common.skeleton import Skeleton
from common.wire.codec import decode, encode
from common.wire.instance import draw_instance
from common.wire.lease import lease_id
from common.wire.messages import ClockQuery, Command, CommandEcho, RobotState
from common.wire.sender import operator_of
from common.wire.topics import CALL, CLOCK, COMMAND, CONTROL, STATE, STOP, SUMMARY
from slave.announce import Announcer
from slave.guard import Guard
from slave.guard.config import GuardConfig
from slave.guard.control import Control
from slave.requests import Requests, UnreadMessages
from slave.traffic import CommandTraffic

GUARD_EVERY, UNHEARD_EVERY = 5, 20
"""Of the 50 turns a second, those in which the guard is stepped: of a robot that is heard, and of others."""
_FIRST_STATE = 1 << 40
"""Of this size a number is packed into nine bytes, and so are stamps: later ones fit into their place."""
_NUMBERS = struct.Struct(">BQBQBQ")
"""A state's sequence, sent_ns and encoder_ns in msgpack, one after the other."""
_UINT64 = 0xCF


class LightRobot:
    """One robot on a session that it may share with others. Call `turn` 50 times a second."""

    def __init__(self, session: LinkSession, name: str, skeleton: Skeleton) -> None:
        self._skeleton = skeleton
        self._joints = len(skeleton.joints)
        self._name = name
        self._instance = draw_instance()
        self.guard = Guard(name, skeleton, GuardConfig())
        self._clock = SlaveExchange()
        self._announcer = Announcer(name, self._instance)
        self._requests = Requests(
            self._instance, "light", Control(""), self._clock, traffic=CommandTraffic(),
            namesakes=Namesakes(self._instance), unread=UnreadMessages(name),
        )  # fmt: skip
        self._position_rad = np.zeros(self._joints)
        self._valid = np.ones(self._joints, np.bool_)
        self._echo: CommandEcho | None = None
        self._heard = False
        self._states, self._turns = _FIRST_STATE, 0
        self._said: tuple[object, ...] = ()
        self._encoded = bytearray()
        self._numbers_at = 0
        self.accepted = 0
        link = session.link(name)
        self._put_state = link.publish(STATE, self._on_wanted)
        self._put_summary = link.publish(SUMMARY)
        link.subscribe_keys(COMMAND, self._on_command)
        link.answer_keys(CONTROL, self._on_control)
        link.answer(STOP, lambda payload, _: self._requests.answer(self.guard, payload, monotonic_ns()))
        link.answer(CLOCK, self._on_clock)
        link.answer(CALL, lambda payload, _: self._announcer.on_call(payload, self.guard, monotonic_ns()))
        link.declare_alive("slave", self._instance, ["light"], skeleton.name)

    def turn(self) -> None:
        """One fiftieth of a second."""
        self._turns += 1
        now_ns = monotonic_ns()
        if self._heard:
            self._put_state(self._encoded_state(now_ns))
        if self._turns % (GUARD_EVERY if self._heard else UNHEARD_EVERY):
            return
        permission = self.guard.step(now_ns, self._position_rad, self._valid, now_ns)
        if permission.ready:
            self.guard.written(now_ns, self._position_rad, np.zeros(self._joints))
        summary = self._announcer.summary(now_ns, self.guard, {})
        if summary is not None:
            self._put_summary(summary)

    def _on_wanted(self, wanted: bool) -> None:
        self._heard = wanted

    def _on_command(self, key: str, payload: bytes, received_ns: int) -> None:
        try:
            command = replace(decode(payload, Command, self._joints), operator=operator_of(key) or "")
        except CodecError:
            return
        now_ns = monotonic_ns()
        offset = self._clock.estimator.estimate(now_ns)
        if self.guard.admit(command, received_ns, now_ns, offset).accepted:
            self.accepted += 1
            self._echo = CommandEcho(command.sequence, command.stamps.put_ns, received_ns, now_ns, now_ns)

    def _on_control(self, key: str, payload: bytes, _: int) -> bytes:
        return self._requests.answer_operator(self.guard, payload, monotonic_ns(), operator_of(key))

    def _on_clock(self, payload: bytes, received_ns: int) -> bytes:
        reply = self._clock.on_query(decode(payload, ClockQuery), received_ns, monotonic_ns())
        return encode(replace(reply, instance=self._instance))

    def _encoded_state(self, now_ns: int) -> bytes:
        self._states += 1
        guard = self.guard
        said = (guard.state, guard.reason, guard.operator, guard.lease.token, self._echo)
        if said != self._said:
            self._said, self._encoded = said, bytearray(encode(self._state(now_ns)))
            self._numbers_at = self._encoded.index(self._numbers(now_ns))
        _NUMBERS.pack_into(self._encoded, self._numbers_at, *self._numbered(now_ns))
        return bytes(self._encoded)

    def _numbers(self, now_ns: int) -> bytes:
        return _NUMBERS.pack(*self._numbered(now_ns))

    def _numbered(self, now_ns: int) -> tuple[int, ...]:
        return (_UINT64, self._states, _UINT64, now_ns, _UINT64, now_ns)

    def _state(self, now_ns: int) -> RobotState:
        offset = self._clock.estimator.estimate(now_ns)
        return RobotState(
            robot=self._name,
            sequence=self._states,
            sent_ns=now_ns,
            encoder_ns=now_ns,
            guard=self.guard.state,
            reason=self.guard.reason,
            operator=self.guard.operator,
            encoder_valid=self._valid,
            position_rad=self._position_rad,
            setpoint_rad=self._position_rad,
            echo=self._echo,
            master_offset_ns=offset.offset_ns,
            offset_bound_ns=offset.bound_ns if offset.trusted else -1,
            lease_id=lease_id(self.guard.lease.token),
            instance=self._instance,
        )
