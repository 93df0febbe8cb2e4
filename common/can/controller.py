"""The state of a CAN controller, and what its error frames say in words. Pure.

ISO 11898-1: a controller counts errors. From 96 on it is in error-warning, above 127 error-passive (it may no
longer destroy others' frames), above 255 it is bus-off: it has left the bus, neither sends nor hears, and
comes back only when it is restarted.
"""

from __future__ import annotations

from enum import StrEnum


class Controller(StrEnum):
    """The states, in the words of the standard; in the order of the kernel's enum can_state."""

    ERROR_ACTIVE = "error-active"
    ERROR_WARNING = "error-warning"
    ERROR_PASSIVE = "error-passive"
    BUS_OFF = "bus-off"
    STOPPED = "stopped"
    SLEEPING = "sleeping"


CANNOT_SPEAK = frozenset({Controller.BUS_OFF, Controller.STOPPED, Controller.SLEEPING})

# linux/can/error.h: classes in the identifier, details in the data
_CONTROLLER, _PROTOCOL, _TRANSCEIVER, _NO_ACK = 0x04, 0x08, 0x10, 0x20
_BUS_OFF, _BUS_ERROR, RESTARTED, _COUNTERS = 0x40, 0x80, 0x100, 0x200
_BY_DETAIL = (
    (0x30, Controller.ERROR_PASSIVE),
    (0x0C, Controller.ERROR_WARNING),
    (0x40, Controller.ERROR_ACTIVE),
)
_OVERFLOW = {0x01: "the controller lost frames that came in", 0x02: "the controller lost frames to send"}


def of_error_frame(error_id: int, data: bytes) -> Controller | None:
    """What a SocketCAN error frame says of the controller's state; None where it says nothing of it."""
    if error_id & _BUS_OFF:
        return Controller.BUS_OFF
    if error_id & _CONTROLLER and len(data) > 1:
        for mask, state in _BY_DETAIL:
            if data[1] & mask:
                return state
    return Controller.ERROR_ACTIVE if error_id & RESTARTED else None


def error_words(error_id: int, data: bytes) -> str:
    """A SocketCAN error frame in words."""
    words = []
    state = of_error_frame(error_id, data)
    if error_id & RESTARTED:
        words.append("the controller was restarted")
    elif state is not None:
        words.append(f"the controller is {state}")
    if error_id & _CONTROLLER and len(data) > 1:
        words += [text for bit, text in _OVERFLOW.items() if data[1] & bit]
    if error_id & _NO_ACK:
        words.append("no node acknowledges: there is no other node on the bus, or the wire is cut")
    if error_id & (_PROTOCOL | _BUS_ERROR):
        words.append("frames are destroyed: look at the bit rate, the wiring, 120 Ω at both ends")
    if error_id & _TRANSCEIVER:
        words.append("the transceiver reports a fault of the wires")
    if error_id & _COUNTERS and len(data) > 7:
        words.append(f"{data[6]} errors of sending and {data[7]} of receiving counted")
    return "; ".join(words) or f"error frame {error_id:#x}"


def bus_off_words(channel: str, restart_ms: int) -> str:
    """What bus-off means and what to do. `restart_ms`: 0 where the kernel does not restart the controller."""
    if restart_ms:
        restart = f"the kernel restarts it after {restart_ms} ms (restart-ms)"
    else:
        restart = (
            f"`ip link set {channel} type can restart` restarts it, "
            f"`ip link set {channel} type can restart-ms 100` lets it recover by itself"
        )
    return (
        "bus-off: the controller has left the bus after too many errors; look at the wiring, 120 Ω at both "
        f"ends, and that all speak at one bit rate; {restart}"
    )
