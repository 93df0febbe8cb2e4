"""What the drives do, seen SYNC by SYNC: which may be enabled, and which must be stopped at once. Pure."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from common.clock import NS_PER_MS
from common.quaternion import Array
from common.wire.messages import Mask
from slave.encoders.agreement import EncoderAgreement
from slave.encoders.counts import Encoders
from slave.encoders.uncommanded import STILL_RAD, MotionPatience, UncommandedMotion
from slave.servos.canopen.answers import DriveAnswers
from slave.servos.canopen.start_check import CHECKED_SYNCS, JointPlace, refusal
from slave.servos.canopen.status_bits import BAD_SYNCS, GOOD, WARNING, WATCHED, wrong_bits
from slave.servos.canopen.units import DriveUnits

_SPAN_NS = 120 * NS_PER_MS
"""How late a drive may follow."""
_PATIENCE = MotionPatience(plain_ns=0, shaken_ns=80 * NS_PER_MS)
"""SYNCs are 20 ms apart, and answers are judged before the next one: there is no time to wait for another."""
_REFUSED_SYNCS = 10
"""SYNCs after which a drive that may not be enabled has failed."""
_MOVES_SYNCS = 100
"""And so has one that does not come to rest."""
_TWICE = 2
"""A drive that has answered so much oftener than it was asked is two."""


class DriveWatch:
    """All drives of one robot."""

    def __init__(
        self,
        joint_names: Sequence[str],
        units: DriveUnits,
        encoders: Encoders,
        *,
        period_ns: int,
        pending_ns: int,
        last_known_rad: Mapping[str, float],
        single: Mask | None = None,
    ) -> None:
        """Answers to the SYNCs of the last `pending_ns` may still be on their way.

        `single` (J,): whose angle the drive alone tells, so that nothing can contradict it.
        """
        joints = len(joint_names)
        self._names = tuple(joint_names)
        self._units = units
        self._single: Mask = np.zeros(joints, np.bool_) if single is None else single
        self._encoders = encoders
        self._last_known = [last_known_rad.get(name) for name in joint_names]
        self._unanswered = [0] * joints
        self._most_pending = 1 + pending_ns // period_ns
        self._passed = [0] * joints
        self._refused = [0] * joints
        self._restless = [0] * joints
        self._anchor_rad: Array = np.full(joints, np.nan)
        self._bad_bits: NDArray[np.int64] = np.zeros(joints, np.int64)
        self._motion = UncommandedMotion(joint_names, patience=_PATIENCE)
        self._agreement = EncoderAgreement(joint_names)
        self._targets_rad: Array = np.zeros((max(2, _SPAN_NS // period_ns), joints))
        self._row = 0
        self._on: Mask = np.zeros(joints, np.bool_)
        self.encoder_rad: Array = np.zeros(joints)
        """(J,) of the newest answers."""
        self.drive_rad: Array = np.zeros(joints)

    def asked(self) -> None:
        """A SYNC is sent."""
        most = self._most_pending
        self._unanswered = [min(count + 1, most) for count in self._unanswered]

    def answered(self, drive: int) -> str:
        """A drive's answer has come; why there seem to be two of it, or empty."""
        self._unanswered[drive] -= 1
        if self._unanswered[drive] > -_TWICE:
            return ""
        return "answers each SYNC more than once: two drives have its id, or its frames are repeated"

    def connect(self, drive: int) -> None:
        """From now on a drive answers SYNCs."""
        self._unanswered[drive] = 0
        self.restart(drive)

    def restart(self, drive: int) -> None:
        """A drive is to be checked before it is enabled."""
        self._passed[drive] = self._refused[drive] = self._restless[drive] = 0
        self._anchor_rad[drive] = np.nan
        self._bad_bits[drive] = 0
        self._on[drive] = False

    def take(self, seen: DriveAnswers) -> None:
        """The newest answers: angles."""
        self.drive_rad = self._units.angle_rad(seen.position)
        self.encoder_rad = self._encoders.position_rad(seen.encoder_counts)

    def check(self, drive: int, seen: DriveAnswers) -> tuple[bool, str]:
        """Whether a drive that waits and has answered may be enabled, or why it never may."""
        here = float(self.drive_rad[drive])
        if not abs(here - self._anchor_rad[drive]) <= STILL_RAD:
            first = math.isnan(self._anchor_rad[drive])
            self._anchor_rad[drive], self._passed[drive] = here, 0
            self._restless[drive] += not first
        why = refusal(self._place(drive, seen), int(seen.statusword[drive]))
        self._refused[drive] = self._refused[drive] + 1 if why else 0
        self._passed[drive] = 0 if why else self._passed[drive] + 1
        if self._refused[drive] >= _REFUSED_SYNCS:
            return False, why
        if self._restless[drive] >= _MOVES_SYNCS:
            return False, "moves although it has not been enabled"
        return self._passed[drive] >= CHECKED_SYNCS, ""

    def judge(self, seen: DriveAnswers, on: Mask, running: Mask) -> dict[int, str]:
        """Which of the drives (J,) that are switched on must be stopped now, and why.

        `on`: on the way to running, or running.
        """
        begun = on & ~self._on
        if begun.any():
            self._motion.begin(seen.synced_ns, begun, self._anchor_rad)
            self._targets_rad[:, begun] = self._anchor_rad[begun]
        self._on = on
        heard = seen.fresh & on
        span = self._targets_rad.min(axis=0), self._targets_rad.max(axis=0)
        moves = self._motion.judge(seen.synced_ns, span, self.drive_rad, heard)
        differs = self._agreement.judge(
            self.drive_rad, self.encoder_rad, seen.fresh & seen.encoder_valid & ~self._single
        )
        bad = (seen.statusword & WATCHED) != GOOD
        self._bad_bits = np.where(seen.fresh & running, np.where(bad, self._bad_bits + 1, 0), self._bad_bits)
        ignores = running & (self._bad_bits >= BAD_SYNCS)
        wrong = (moves | differs | ignores) & on
        return {j: self._words(j, int(seen.statusword[j]), ignores) for j in np.flatnonzero(wrong).tolist()}

    def aim(self, target_rad: Array, running: Mask) -> None:
        """Where the drives (J,) are sent with the next SYNC; those that do not run yet are to stay."""
        self._targets_rad[self._row] = np.where(running, target_rad, self._anchor_rad)
        self._row = (self._row + 1) % len(self._targets_rad)

    def warnings(self, seen: DriveAnswers) -> dict[str, str]:
        """Drives whose statusword warns (bit 7), by joint: no reason to stop yet."""
        warned = np.flatnonzero((seen.statusword & WARNING) != 0).tolist()
        return {self._names[j]: "its drive warns: something is about to fail (bit 7)" for j in warned}

    def _words(self, drive: int, statusword: int, ignores: Mask) -> str:
        name = self._names[drive]
        problems = [wrong_bits(statusword)] if ignores[drive] else []
        problems += [words[name] for words in (self._agreement.words, self._motion.words) if name in words]
        return "; ".join(problems)

    def _place(self, drive: int, seen: DriveAnswers) -> JointPlace:
        units = self._units
        return JointPlace(
            drive_rad=float(self.drive_rad[drive]),
            encoder_rad=float(self.encoder_rad[drive]) if seen.encoder_valid[drive] else None,
            last_known_rad=self._last_known[drive],
            limits_rad=units.limits_rad[drive],
            increments_per_rad=float(units.scale[drive]),
            zero_increments=int(units.zero[drive]),
            single=bool(self._single[drive]),
        )
