"""Whether each joint stands where its encoder says, and stays there. Checked in every state and backend.

Before the robot is held anywhere: each joint within its range, and its angle confirmed by a second reading:
the drive's own beside the encoder's, or the last known one, or a person's confirmation. Then
the two readings must always agree, and a joint that moves without or against its setpoint is stopped.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from types import MappingProxyType

import numpy as np

from common.clock import NS_PER_MS
from common.quaternion import Array
from common.wire.messages import Mask
from slave.encoders.agreement import READINGS as AGREEMENT_READINGS
from slave.encoders.agreement import EncoderAgreement
from slave.encoders.uncommanded import MotionPatience, UncommandedMotion

BEYOND_RAD = math.radians(8.0)
"""A joint further than this beyond its range is not where its encoder says."""
NEAR_RAD = math.radians(5.0)
"""A joint that was not turned while it was off stands within this of its last angle."""
STILL_RAD = math.radians(1.0)
"""At the output, behind the gear's play, a joint that stands may be moved by so much."""
READINGS = 2
PATIENCE = MotionPatience(plain_ns=20 * NS_PER_MS, shaken_ns=80 * NS_PER_MS)
"""An arm that brakes at its limits throws a light wrist outwards for 56 ms; else no joint is ever astray."""


class Placement:
    """Whether J joints stand where their readings say.

    `last_known_rad`: of joints whose angle one reading alone tells, the last known one, or NaN. All other
    joints have a second reading, or are simulated.
    """

    def __init__(
        self,
        joint_names: Sequence[str],
        lower_rad: Array,
        upper_rad: Array,
        *,
        last_known_rad: Mapping[str, float] = MappingProxyType({}),
    ) -> None:
        self._names = tuple(joint_names)
        self._lower_rad, self._upper_rad = lower_rad, upper_rad
        self._known_rad = np.array([last_known_rad.get(name, np.nan) for name in joint_names])
        self._asked: Mask = np.array([name in last_known_rad for name in joint_names])
        self._agreement = EncoderAgreement(joint_names)
        self._motion = UncommandedMotion(joint_names, STILL_RAD, readings=READINGS, patience=PATIENCE)
        self._first_rad: Array = np.full(len(self._names), np.nan)
        self._read_ns: int | None = None
        self._compared = 0

    @property
    def differ(self) -> Mapping[str, str]:
        """A text for each joint whose drive and encoder disagree, by joint."""
        return self._agreement.words

    def take(
        self,
        read_ns: int,
        position_rad: Array,
        good: Mask,
        *,
        drive_rad: Array | None,
        span: tuple[Array, Array] | None,
        under_way: bool = False,
    ) -> str | None:
        """Take a reading (J,) that is `good` (J,). Returns a text if a joint moves uncommanded, else None.

        `span` (J,) each: where the setpoint was lately, or None before there is any: then nothing may move.
        `under_way`: somebody is engaged. The same reading twice counts once.
        """
        if read_ns == self._read_ns:
            return None
        self._read_ns = read_ns
        if drive_rad is not None:
            self._agreement.judge(drive_rad, position_rad, good)
            self._compared += 1
        if span is None:
            first = good & np.isnan(self._first_rad)
            if first.any():
                np.copyto(self._first_rad, position_rad, where=first)
                self._motion.begin(read_ns, first, position_rad)
            span = self._first_rad, self._first_rad
        moves = self._motion.judge(read_ns, span, position_rad, good, under_way=under_way)
        if not moves.any():
            return None
        joint = self._names[int(moves.argmax())]
        return f"{joint} {self._motion.words[joint]}"

    def unplaced(self, position_rad: Array) -> str | None:
        """Why the robot may not be held where its joints (J,) seem to stand, or None."""
        if 0 < self._compared < AGREEMENT_READINGS:
            return "compares the drives' angles with the encoders'"
        for joint, words in self._agreement.words.items():
            return f"{joint}: {words}"
        beyond = np.maximum(self._lower_rad - position_rad, position_rad - self._upper_rad)
        worst = int(beyond.argmax())
        if beyond[worst] > BEYOND_RAD:
            return (
                f"{self._names[worst]} stands at {_deg(position_rad[worst])}, {_deg(beyond[worst])} beyond "
                "its range: check its zero and its encoder, or turn it back by hand"
            )
        return self._unknown(position_rad)

    def confirm(self, position_rad: Array) -> None:
        """A person has confirmed that the joints (J,) stand here."""
        self._known_rad = position_rad.copy()

    def _unknown(self, position_rad: Array) -> str | None:
        far = self._asked & ~(np.abs(position_rad - self._known_rad) <= NEAR_RAD)
        if not far.any():
            return None
        unconfirmed = []
        for j in np.flatnonzero(far).tolist():
            known = self._known_rad[j]
            before = "no earlier angle known" if np.isnan(known) else f"last known at {_deg(known)}"
            unconfirmed.append(f"{self._names[j]} reads {_deg(position_rad[j])}, {before}")
        return f"compare with the robot, then confirm its posture by `tandem home`: {'; '.join(unconfirmed)}"


def _deg(angle_rad: float) -> str:
    return f"{math.degrees(angle_rad):.1f}°"
