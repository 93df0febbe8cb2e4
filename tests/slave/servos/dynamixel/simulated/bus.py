"""Servos on one bus: the bytes of instructions in, the bytes of all answers out. Pure; time is given."""

from __future__ import annotations

from collections.abc import Iterable

from slave.servos.dynamixel import registers as x
from tests.slave.servos.dynamixel.simulated import packets
from tests.slave.servos.dynamixel.simulated.packets import Packet, Parser, frame
from tests.slave.servos.dynamixel.simulated.servo import OK, SimulatedServo

_UNKNOWN_INSTRUCTION = 2


class SimulatedBus:
    """Servos by id, as one half-duplex line has them."""

    def __init__(self, servos: Iterable[SimulatedServo]) -> None:
        self.servos = {servo.id: servo for servo in servos}
        self.parser = Parser()

    def feed(self, data: bytes, now_ns: int) -> bytes:
        """The answers to whatever instructions these bytes complete."""
        return b"".join(self._answer(packet, now_ns) for packet in self.parser.feed(data))

    def advance(self, now_ns: int) -> None:
        """Let all servos move on to `now_ns`."""
        for servo in self.servos.values():
            servo.advance(now_ns)

    def _answer(self, packet: Packet, now_ns: int) -> bytes:
        if packet.instruction == packets.STATUS:
            return b""
        self.advance(now_ns)
        for servo in self.servos.values():
            if not servo.silent:
                servo.heard(now_ns)
        if packet.instruction == packets.SYNC_READ:
            return self._sync_read(packet.parameters)
        if packet.instruction == packets.SYNC_WRITE:
            self._sync_write(packet.parameters)
            return b""
        everyone = packet.servo == packets.BROADCAST
        asked = self.servos.values() if everyone else [self.servos.get(packet.servo)]
        answers = [self._one(servo, packet) for servo in asked if servo is not None and not servo.silent]
        # bus-wide, only a ping is answered
        return b"".join(answers) if not everyone or packet.instruction == packets.PING else b""

    def _one(self, servo: SimulatedServo, packet: Packet) -> bytes:
        data, level = packet.parameters, servo.get(x.STATUS_RETURN)
        match packet.instruction:
            case packets.PING:
                known = servo.get(x.MODEL).to_bytes(2, "little") + bytes([servo.get(x.FIRMWARE)])
                return _status(servo, OK, known)
            case packets.READ if len(data) == 4:
                error, found = servo.read(_word(data, 0), _word(data, 2))
                return _status(servo, error, found) if level >= 1 else b""
            case packets.WRITE if len(data) > 2:
                error = servo.write(_word(data, 0), data[2:])
                return _status(servo, error) if level >= 2 else b""
            case packets.REBOOT:
                servo.power_cycle()
                return _status(servo, OK) if level >= 2 else b""
        return _status(servo, _UNKNOWN_INSTRUCTION) if level >= 2 else b""

    def _sync_read(self, data: bytes) -> bytes:
        if len(data) < 4:
            return b""
        answers = []
        for i in data[4:]:
            servo = self.servos.get(i)
            if servo is not None and not servo.silent and servo.get(x.STATUS_RETURN) >= 1:
                error, found = servo.read(_word(data, 0), _word(data, 2))
                answers.append(_status(servo, error, found))
        return b"".join(answers)

    def _sync_write(self, data: bytes) -> None:
        if len(data) < 4:
            return
        address, size = _word(data, 0), _word(data, 2)
        for at in range(4, len(data) - size, 1 + size):
            servo = self.servos.get(data[at])
            if servo is not None and not servo.silent:
                servo.write(address, data[at + 1 : at + 1 + size])


def _status(servo: SimulatedServo, error: int, parameters: bytes = b"") -> bytes:
    return frame(servo.id, packets.STATUS, bytes([error | servo.alert]) + parameters)


def _word(data: bytes, at: int) -> int:
    return int.from_bytes(data[at : at + 2], "little")
