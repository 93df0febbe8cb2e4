"""Requests to servos and their answers, over `dynamixel_sdk`'s packet handler."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from common.errors import RobotError
from common.process.extras import missing_extra
from slave.servos.dynamixel.port import Port
from slave.servos.dynamixel.registers import Register

_PROTOCOL = 2.0
_COMM_SUCCESS = 0
"""The SDK's COMM_SUCCESS."""
_TRIES = 3
_ALERT = 0x80
"""In a status packet's error byte: the servo has a hardware error."""
_ID, _LENGTH, _PARAMETERS = 4, 5, 9
_STATUS_BYTES = 11
_STATUS_LENGTH = 4
"""The length of an answer without parameters, as its length field counts."""
_REFUSALS = {
    1: "it failed to carry this out",
    2: "it does not know this instruction",
    3: "it received a broken packet",
    4: "the value is out of range",
    5: "the value has the wrong length",
    6: "the value is beyond its limits",
    7: "it cannot be written now",
}


class ServoError(RobotError):
    """A servo does not answer, or refuses; the text leaves out its name."""


@dataclass(frozen=True, slots=True)
class ServoAnswer:
    """One servo's answer to a read of all servos."""

    value: int
    alert: bool
    """It has a hardware error."""


class Bus:
    """One open serial bus. All methods raise PortLostError where the port has gone."""

    def __init__(self, port: Port) -> None:
        try:
            # imported here: a host without such servos does not need the package
            from dynamixel_sdk import PacketHandler
        except ModuleNotFoundError as error:
            raise RobotError(missing_extra(error) or str(error)) from None
        self._port = port
        self._packets: Any = PacketHandler(_PROTOCOL)
        self.broken = 0
        """Answers that were cut short or failed their checksum."""
        self.quickest_s = 0.0
        """The least time from a request to one servo to its answer; 0 before any."""

    @property
    def late_bytes(self) -> int:
        """Bytes that came after the time-out."""
        return self._port.late_bytes

    def close(self) -> None:
        """Safe to call twice."""
        self._port.close()

    @contextlib.contextmanager
    def patient(self, reply_timeout_s: float) -> Iterator[None]:
        """Wait at least so long for each answer."""
        before_s = self._port.reply_timeout_s
        self._port.reply_timeout_s = max(before_s, reply_timeout_s)
        try:
            yield
        finally:
            self._port.reply_timeout_s = before_s

    def ping(self, servo: int) -> int:
        """The model number of a servo. Raises ServoError."""
        return int(self._asked(lambda: self._packets.ping(self._port, servo))[0])

    def read(self, servo: int, register: Register) -> int:
        """A register's value. Raises ServoError."""
        return register.decode(self.read_bytes(servo, register))

    def read_bytes(self, servo: int, register: Register, tries: int = _TRIES) -> bytes:
        """A register's bytes. Raises ServoError."""

        def ask() -> tuple[list[int], int, int]:
            data, result, error = self._packets.readTxRx(self._port, servo, register.address, register.size)
            # an answer to another read, or one that is cut short within a valid checksum
            short = result == _COMM_SUCCESS and not error & ~_ALERT and len(data) != register.size
            return data, -1 if short else result, error

        return bytes(self._asked(ask, tries)[0])

    def write(self, servo: int, register: Register, value: int) -> None:
        """Set a register. Raises ServoError."""
        data = list(register.encode(value))

        def ask() -> tuple[None, int, int]:
            result, error = self._packets.writeTxRx(self._port, servo, register.address, register.size, data)
            return None, result, error

        self._asked(ask)

    def write_all(self, register: Register, values: Mapping[int, int]) -> None:
        """Set one register of many servos at once; none of them answers.

        The library does not stuff packets of this kind: no bytes FF FF FD may come of `values`,
        as none do of positions, rates and watchdogs that are not negative.
        """
        if not values:
            return
        flat: list[int] = []
        for servo, value in values.items():
            flat += [servo, *register.encode(value)]
        self._packets.syncWriteTxOnly(self._port, register.address, register.size, flat, len(flat))

    def read_all(self, register: Register, servos: Sequence[int]) -> dict[int, ServoAnswer]:
        """One register of many servos at once: of all that answer in time.

        The library's own group read gives up at the first servo that is silent, and eats the answers
        of those behind it; so the answers are separated here.
        """
        out: dict[int, ServoAnswer] = {}
        if not servos:
            return out
        port, asked = self._port, set(servos)
        result = self._packets.syncReadTx(
            port, register.address, register.size, list(servos), len(servos), False
        )
        if result != _COMM_SUCCESS:
            port.is_using = False
            return out
        port.setPacketTimeout(len(servos) * (_STATUS_BYTES + register.size))
        while len(out) < len(asked):
            packet, result = self._packets.rxPacket(port, False)
            if result == _COMM_SUCCESS:
                servo, data = packet[_ID], bytes(packet[_PARAMETERS : _PARAMETERS + register.size])
                length = packet[_LENGTH] | packet[_LENGTH + 1] << 8
                # an answer to something else, that came too late for it, has another length
                if servo in asked and length == _STATUS_LENGTH + register.size:
                    out[servo] = ServoAnswer(register.decode(data), bool(packet[_PARAMETERS - 1] & _ALERT))
                continue
            self.broken += bool(packet)
            if port.isPacketTimeout():
                break
        return out

    def _asked(self, ask: Any, tries: int = _TRIES) -> Any:
        for i in range(tries):
            if i:
                # the answer that did not come in time must not be taken for the next one's
                self._port.settle()
            asked_s = time.monotonic()
            answer = ask()
            took_s = time.monotonic() - asked_s
            result, error = answer[-2:]
            if result == _COMM_SUCCESS:
                self.quickest_s = min(self.quickest_s or took_s, took_s)
                refusal = error & ~_ALERT
                if not refusal:
                    return answer
                raise ServoError(_REFUSALS.get(refusal, f"it answers with error {refusal}"))
        raise ServoError("it does not answer")
