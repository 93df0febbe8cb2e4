"""How simulated drives tell that their safe torque off (STO) input has opened, as makers' drives do. Pure.

CiA 402 leaves it to the maker. Common to all is that the motor has no torque, whatever the bus says.
"""

from __future__ import annotations

from deploy.sim.drives.faults import DriveFault
from slave.servos.canopen.cia402 import Power

DROPS = (DriveFault.STO, DriveFault.STO_QUIET)
"""Drives that fall to "switch on disabled", and leave it only with torque."""
STO_EMERGENCY = (0x8A88, 0x81)
"""maxon EPOS4: a fault once the power stage is on; it cannot be reset while the input is open."""
CLOSED_INPUT, STO_INPUT = 1 << 16, 1 << 31
"""Bits of 60FDh: the first digital input, whose contact is closed; "STO active" (Beckhoff AX8000)."""
_ON = (Power.SWITCHED_ON, Power.ENABLED, Power.QUICK_STOP)


def without_torque(fault: DriveFault, before: Power, after: Power) -> Power:
    """The state that a drive really takes; `after`: the one that it would take with torque."""
    if fault in DROPS:
        return Power.SWITCH_ON_DISABLED if after in (Power.READY, *_ON) else after
    if fault is DriveFault.STO_FAULT:
        return Power.FAULT if after in _ON or before is Power.FAULT else after
    return after


def inputs(fault: DriveFault) -> int:
    """60FDh."""
    closed = 0 if fault is DriveFault.INPUT_OPEN else CLOSED_INPUT
    return closed | (STO_INPUT if fault in (*DROPS, DriveFault.STO_FAULT) else 0)
