"""What a drive may lack and what it may not: the parts of its settings, and refusals in words. Pure."""

from __future__ import annotations

from collections.abc import Mapping

from slave.servos.canopen.eds import Eds
from slave.servos.canopen.mapping import Held

MODES = 0x6502, 0
EFFORT, EFFORT_PDO, INPUTS = "effort", "effort PDO", "inputs"
LIMIT = "torque limit"
BEAT, GUARDING, MAPPING, ANSWER = "heartbeat", "node guarding", "mapping", "answer at each SYNC"
LOSS, QUICK_STOP, PERIOD, WIDE_PERIOD = "6007h", "605Ah", "60C2h", "60C2h of 16 bits"
WRONG_LENGTH = "wrong length"
_OF_VALUE = ("value out of range", "value too high", "value too low")
"""Refusals of a value by a drive that has the object."""

_LEFT_OUT = {
    LOSS: "6007h: what it does when the slave dies is its maker's choice",
    QUICK_STOP: "605Ah: after a quick stop it lets the joint go",
    "607Dh": "607Dh: no software limits of its own; the guard's hold",
    "6065h": "6065h and 6066h: its following error window is its own",
    "6085h": "6085h: its quick stop ramp is its own",
    PERIOD: "60C2h: it does not know the SYNC period",
    BEAT: "1016h and 1017h: node guarding takes their place",
    MAPPING: "its PDOs cannot be mapped anew and are used as they are",
}
"""What it means that a drive lacks a part, for a person."""

Lacks = Mapping[str, str]
"""Parts that a drive refused, and why."""


class SetupRefusedError(Exception):
    """A text for why a drive cannot be used, and what to do."""


def left_out(lacks: Lacks) -> list[str]:
    """What the drive lacks that it may lack, in words."""
    lacking = [part for part in lacks if part != PERIOD or _period_refused(lacks)]
    return [_LEFT_OUT[part] for part in lacking if part in _LEFT_OUT]


def check_identity(held: Held, eds: Eds | None) -> None:
    """The drive is the one of its EDS. Raises SetupRefusedError."""
    if eds is None:
        return
    for sub, said in ((1, eds.vendor), (2, eds.product)):
        found = held.get((0x1018, sub))
        if said and found is not None and found != said:
            raise SetupRefusedError(
                f"is another drive than its eds says: 1018h:{sub} is {found:#x}, {eds.name} says "
                f"{said:#x}; name the EDS of this drive and firmware"
            )


def choose_mode(held: Held, asked: int | None, eds: Eds | None) -> int:
    """The mode of operation: 8 cyclic synchronous, 7 interpolated position. Raises SetupRefusedError."""
    supported = held.get(MODES) or (eds.value(MODES) if eds else None)
    if not supported:
        return asked or 8  # 6061h will tell
    has = [mode for mode in (8, 7) if supported >> mode - 1 & 1]
    if not has:
        raise SetupRefusedError(
            "has neither cyclic synchronous position mode (8) nor interpolated position mode (7), by "
            f"6502h = {supported:#x}: use a drive or a firmware that has one of them"
        )
    if asked is not None and asked not in has:
        raise SetupRefusedError(f"has mode {has[0]} only, by 6502h = {supported:#x}: set mode = {has[0]}")
    return asked or has[0]


def check_holding(lacks: Lacks, holds_itself: bool) -> None:
    """The joint stays where it is when the drive stops. Raises SetupRefusedError."""
    missing = [part for part in (LOSS, QUICK_STOP) if part in lacks]
    if missing and not holds_itself:
        raise SetupRefusedError(
            f"lacks {' and '.join(missing)} ({lacks[missing[0]]}): it may let the joint go when it stops or "
            "the slave dies; with a brake or a self-locking gear, set holds_itself = true"
        )


def check_life(lacks: Lacks) -> None:
    """The drive notices that the slave has died. Raises SetupRefusedError."""
    if GUARDING in lacks:
        raise SetupRefusedError(
            f"cannot notice that the slave has died: it has neither heartbeats ({lacks[BEAT]}) nor "
            f"node guarding ({lacks[GUARDING]}); use a drive or a firmware that has one of them"
        )


def check_period(lacks: Lacks, mode: int, period_ms: int) -> None:
    """A drive that interpolates knows the SYNC period. Raises SetupRefusedError."""
    refused = lacks.get(WIDE_PERIOD) or lacks.get(PERIOD, "")
    if any(words in refused for words in _OF_VALUE):
        raise SetupRefusedError(
            f"does not take a SYNC period of {period_ms} ms ({refused}), and would go to each "
            "target by jerks: set sync_hz in [servos.canopen] to what its manual permits"
        )
    if mode == 7 and _period_refused(lacks):
        raise SetupRefusedError(
            f"cannot interpolate: it does not take the SYNC period ({lacks[PERIOD]}), which interpolated "
            "position mode (7) needs; use a drive or a firmware with mode 8"
        )


def check_inputs(lacks: Lacks, wanted: bool, told: bool) -> None:
    """A drive with an emergency stop input tells it. Raises SetupRefusedError."""
    if wanted and (not told or (INPUTS in lacks and MAPPING not in lacks)):
        raise SetupRefusedError(
            f"cannot send its digital inputs ({lacks.get(INPUTS, 'no PDO has 60FDh')}): take it out of "
            "tell_inputs, and wire its emergency stop input elsewhere"
        )


def check_answer(lacks: Lacks) -> None:
    """The drive answers each SYNC. Raises SetupRefusedError."""
    if ANSWER in lacks:
        raise SetupRefusedError(
            f"does not answer each SYNC ({lacks[ANSWER]}): set its TPDO's transmission type to 1 with its "
            "maker's tool"
        )


def _period_refused(lacks: Lacks) -> bool:
    return PERIOD in lacks and (WRONG_LENGTH not in lacks[PERIOD] or WIDE_PERIOD in lacks)
