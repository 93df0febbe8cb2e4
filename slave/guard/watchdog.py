"""What must keep coming while the robot moves; each loss concerns the whole robot.

Times count from arrival on the slave's own clock, never from a sender's stamp.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from common.clock import to_s
from common.quaternion import Array
from common.wire.messages import Mask
from slave.guard.body import Body

_NEVER_NS = -(1 << 62)


class EncoderLife:
    """When each joint's encoder last gave a valid reading."""

    def __init__(self, joint_names: Sequence[str], timeout_ns: int) -> None:
        self._names = tuple(joint_names)
        self._timeout_ns = timeout_ns
        self._seen_ns: NDArray[np.int64] = np.full(len(self._names), _NEVER_NS)
        self.position_rad: Array = np.zeros(len(self._names))
        """(J,) the last valid reading of each joint."""

    def update(self, position_rad: Array, valid: Mask, read_ns: int) -> None:
        """Take one reading (J,). An angle that is not finite is not valid, whatever its flag."""
        good = valid & np.isfinite(position_rad)
        np.copyto(self._seen_ns, read_ns, where=good)
        np.copyto(self.position_rad, position_rad, where=good)

    def silence(self, now_ns: int) -> str | None:
        """A text for the joint that is silent longest, or None if all were heard in time.

        A reading from the future counts as none: it comes of a clock that cannot be trusted.
        """
        age_ns = np.abs(now_ns - self._seen_ns)
        worst = int(age_ns.argmax())
        if age_ns[worst] <= self._timeout_ns:
            return None
        if self._seen_ns[worst] == _NEVER_NS:
            return f"no valid encoder reading of {self._names[worst]} yet"
        return f"no valid encoder reading of {self._names[worst]} for {to_s(int(age_ns[worst])):.2f} s"


@dataclass(frozen=True, slots=True)
class Signs:
    """The signs of life at one moment."""

    now_ns: int
    leased: bool
    command_ns: int | None
    """Arrival of the last accepted command, None where there was none since the last loss."""
    somebody_ns: int | None
    """Now where the newest accepted command has a valid joint, else arrival of the last one that had."""
    command_timeout_ns: int
    refusal: str
    """Why the last command since then was refused, empty where none was."""
    encoders: EncoderLife
    implausible: str | None
    """More encoders than may be do not agree with the setpoint."""
    body: Body
    clutch_ns: int | None = None
    """Since when the robot waits for the operator's clutch; None where it does not."""
    clutch_max_ns: int = 0
    doubt: str = ""
    """Why the master advises against an engage; empty where it does not."""


@dataclass(frozen=True, slots=True)
class LossWatch:
    """One watched condition. `loss` returns a text for its loss, or None."""

    name: str
    loss: Callable[[Signs], str | None]


def _lease(signs: Signs) -> str | None:
    return None if signs.leased else "the lease has lapsed"


def _command(signs: Signs) -> str | None:
    why = f" (refused: {signs.refusal})" if signs.refusal else ""
    if signs.command_ns is None:
        return f"no command{why}"
    # absolute: an own clock that went back must not keep a dead command alive
    age_ns = abs(signs.now_ns - signs.command_ns)
    if age_ns <= signs.command_timeout_ns:
        return None
    return f"no command for {to_s(age_ns):.2f} s{why}"


def _valid(signs: Signs) -> str | None:
    if signs.somebody_ns is None:
        return "no joint has been valid yet" + (f": {signs.doubt}" if signs.doubt else "")
    age_ns = abs(signs.now_ns - signs.somebody_ns)
    if age_ns <= signs.command_timeout_ns:
        return None
    why = signs.doubt or "check the operator's suit"
    return f"no joint has been valid for {to_s(age_ns):.2f} s: {why}"


def _clutch(signs: Signs) -> str | None:
    if signs.clutch_ns is None or abs(signs.now_ns - signs.clutch_ns) <= signs.clutch_max_ns:
        return None
    return f"the clutch was released for more than {to_s(signs.clutch_max_ns):g} s"


def _encoder(signs: Signs) -> str | None:
    return signs.encoders.silence(signs.now_ns)


def _plausible(signs: Signs) -> str | None:
    return signs.implausible


def _drive(signs: Signs) -> str | None:
    return signs.body.drive_fault


def _base(signs: Signs) -> str | None:
    return signs.body.base


def _contact(signs: Signs) -> str | None:
    return signs.body.contact


def _video(signs: Signs) -> str | None:
    return signs.body.video


def _namesake(signs: Signs) -> str | None:
    return signs.body.namesake


ARRIVAL_WATCHES: tuple[LossWatch, ...] = (
    LossWatch("command", _command),
    LossWatch("lease", _lease),
    # commands without one valid joint come from nobody: a suit that is heard again must not move the robot
    LossWatch("valid", _valid),
    LossWatch("clutch", _clutch),
)
"""Looked at in every step, and before a command is judged: what comes after a gap must not hide the gap."""
BODY_WATCHES: tuple[LossWatch, ...] = (
    LossWatch("encoder", _encoder),
    LossWatch("plausible", _plausible),
    LossWatch("drive", _drive),
    LossWatch("base", _base),
    LossWatch("namesake", _namesake),
    LossWatch("contact", _contact),
    LossWatch("video", _video),
)
"""Looked at in every step, right after the encoders were read."""


def first_loss(watches: Sequence[LossWatch], signs: Signs) -> tuple[str, str] | None:
    """Name and words of the first loss, or None."""
    for watch in watches:
        reason = watch.loss(signs)
        if reason is not None:
            return watch.name, reason
    return None
