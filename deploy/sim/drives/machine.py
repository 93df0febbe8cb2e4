"""The power state machine within a drive: what a controlword makes of its state (CiA 402-2). Pure."""

from __future__ import annotations

from slave.servos.canopen.cia402 import Power
from slave.servos.canopen.status_bits import FOLLOWS, REMOTE, VOLTAGE

STATUSWORDS = {
    Power.NOT_READY: 0x00,
    Power.SWITCH_ON_DISABLED: 0x40,
    Power.READY: 0x21,
    Power.SWITCHED_ON: 0x23,
    Power.ENABLED: 0x27,
    Power.QUICK_STOP: 0x07,
    Power.FAULT_REACTION: 0x0F,
    Power.FAULT: 0x08,
}


def statusword(state: Power) -> int:
    """The statusword of a state (6041h): under remote control, and following its target while enabled."""
    return STATUSWORDS[state] | VOLTAGE | REMOTE | (FOLLOWS if state is Power.ENABLED else 0)


def after(state: Power, controlword: int, last: int, knows_16: bool = True) -> Power:
    """The state that follows; `last` is the controlword before, for the edge of the fault reset.

    `knows_16`: whether "enable operation" leads out of quick stop active, which CiA 402 leaves to the maker.
    """
    if state in (Power.NOT_READY, Power.FAULT_REACTION):
        return state
    if state is Power.FAULT:
        edge = controlword & ~last & 0x80
        return Power.SWITCH_ON_DISABLED if edge else state
    if not controlword & 0x02:
        return Power.SWITCH_ON_DISABLED
    if not controlword & 0x04:
        # quick stop: with power it brakes and stays, without there is nothing to stop
        stops = state in (Power.ENABLED, Power.QUICK_STOP)
        return Power.QUICK_STOP if stops else Power.SWITCH_ON_DISABLED
    return _step(state, controlword & 0x0F, knows_16)


def _step(state: Power, command: int, knows_16: bool) -> Power:
    """Neither voltage nor quick stop is taken away: 6, 7 and F lead up and down the ladder."""
    if state is Power.QUICK_STOP:
        return Power.ENABLED if knows_16 and command == 0x0F else state
    if command == 0x06:
        return Power.READY
    if command == 0x07:
        return Power.SWITCH_ON_DISABLED if state is Power.SWITCH_ON_DISABLED else Power.SWITCHED_ON
    if command == 0x0F and state in (Power.SWITCHED_ON, Power.ENABLED):
        return Power.ENABLED
    if command == 0x0F and state is Power.READY:
        return Power.SWITCHED_ON
    return state
